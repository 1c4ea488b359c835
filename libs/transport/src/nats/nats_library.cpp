#include "nats_library.h"

#include <mapweave/core/error.h>

#include <algorithm>
#include <cstdlib>
#include <vector>

namespace mapweave::transport {
namespace {

constexpr std::int64_t kWriteDeadline_ms = 30'000;

void expect_ok(natsStatus status, const std::string& where, const std::string& remedy) {
  if (status == NATS_OK) return;
  throw Error(ErrorCode::kBadInput, "the NATS client refuses it: " + words_of(status), where, remedy);
}

}  // namespace

std::string shown_url(const std::string& url) {
  const std::size_t scheme = url.find("://"), at = url.rfind('@');
  if (at == std::string::npos) return url;
  return (scheme == std::string::npos ? std::string() : url.substr(0, scheme + 3)) + url.substr(at + 1);
}

std::string words_of(natsStatus status) {
  natsStatus last = NATS_OK;
  const char* words = nats_GetLastError(&last);
  if (words != nullptr && *words != '\0' && last == status) return words;
  return natsStatus_GetText(status);
}

bool is_refusal(natsStatus status) {
  return status == NATS_CONNECTION_AUTH_FAILED || status == NATS_SSL_ERROR ||
         status == NATS_SECURE_CONNECTION_REQUIRED || status == NATS_SECURE_CONNECTION_WANTED;
}

OptionsHandle library_options(const NatsOptions& options) {
  for (const std::string* text : {&options.user, &options.password, &options.token})
    if (std::any_of(text->begin(), text->end(), [](char c) { return c == '"' || c == '\\' || (c >= 0 && c < ' '); }))
      throw Error(ErrorCode::kBadInput, "a user, password or token holds a quotation mark, backslash or line break",
                  shown_url(options.url), "choose others: the NATS client library 3.4 sends such ones wrongly");
  natsOptions* made = nullptr;
  if (natsOptions_Create(&made) != NATS_OK) throw std::bad_alloc();
  OptionsHandle handle(made, &natsOptions_Destroy);
  const std::string where = shown_url(options.url);
  std::vector<std::string> urls;
  for (std::size_t from = 0, to = 0; to != std::string::npos; from = to + 1) {
    to = options.url.find(',', from);
    urls.push_back(options.url.substr(from, to == std::string::npos ? to : to - from));
  }
  std::vector<const char*> list;
  for (const std::string& url : urls) list.push_back(url.c_str());
  expect_ok(natsOptions_SetServers(made, list.data(), static_cast<int>(list.size())), where, "write nats://host:port");
  if (!options.user.empty())
    expect_ok(natsOptions_SetUserInfo(made, options.user.c_str(), options.password.c_str()), where, "");
  if (!options.token.empty()) expect_ok(natsOptions_SetToken(made, options.token.c_str()), where, "");
  if (!options.ca.empty() || !options.ca_text.empty() || options.url.rfind("tls://", 0) == 0)
    expect_ok(natsOptions_SetSecure(made, true), where, "use a NATS client library with TLS");
  if (!options.ca.empty())
    expect_ok(natsOptions_LoadCATrustedCertificates(made, options.ca.c_str()), options.ca,
              "name a PEM file with certificates");
  if (!options.ca_text.empty())
    expect_ok(natsOptions_SetCATrustedCertificates(made, options.ca_text.c_str()), where,
              "these are no certificates: have new keys made");
  if (!options.certificate.empty() || !options.key.empty())
    expect_ok(natsOptions_LoadCertificatesChain(made, options.certificate.c_str(), options.key.c_str()),
              options.certificate, "name a PEM file with a certificate, and one with its key");
  // One attempt; what is lost is made anew here, where every user of the connection learns of it.
  natsOptions_SetAllowReconnect(made, false);
  natsOptions_SetTimeout(made, static_cast<std::int64_t>(options.connect_s * 1e3));
  natsOptions_SetPingInterval(made, static_cast<std::int64_t>(options.silence_s * 1e3));
  natsOptions_SetMaxPingsOut(made, 2);
  natsOptions_SetWriteDeadline(made, kWriteDeadline_ms);
  natsOptions_UseGlobalMessageDelivery(made, true);  // a thread for all subscriptions
  return handle;
}

NatsMessage message_of(natsMsg* from) {
  const auto text = [](const char* letters) { return std::string(letters == nullptr ? "" : letters); };
  NatsMessage message{text(natsMsg_GetSubject(from)), text(natsMsg_GetReply(from)), {}, 0, {}};
  if (const int size = natsMsg_GetDataLength(from); size > 0)
    message.bytes.assign(natsMsg_GetData(from), static_cast<std::size_t>(size));
  const char* value = nullptr;
  if (!message.bytes.empty() || natsMsgHeader_Get(from, "Status", &value) != NATS_OK || value == nullptr)
    return message;
  message.status = std::atoi(value);
  if (natsMsgHeader_Get(from, "Description", &value) == NATS_OK) message.description = text(value);
  return message;
}

Callbacks& Callbacks::all() {
  static auto* const made = new Callbacks;  // outlives the library's threads
  return *made;
}

}  // namespace mapweave::transport
