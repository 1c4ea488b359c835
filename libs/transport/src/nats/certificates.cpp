#include <mapweave/core/error.h>
#include <mapweave/core/hash.h>
#include <mapweave/transport/certificates.h>

#include <arpa/inet.h>
#include <openssl/evp.h>
#include <openssl/pem.h>
#include <openssl/rand.h>
#include <openssl/x509v3.h>

#include <algorithm>
#include <cctype>
#include <memory>

namespace mapweave::transport {
namespace {

using Key = std::unique_ptr<EVP_PKEY, decltype(&EVP_PKEY_free)>;
using Certificate = std::unique_ptr<X509, decltype(&X509_free)>;
using Memory = std::unique_ptr<BIO, decltype(&BIO_free_all)>;

constexpr int kSerialBits = 127;

void expect(bool works, const char* what) {
  if (!works) throw Error(ErrorCode::kInternal, std::string("OpenSSL cannot ") + what);
}

Key new_key() {
  Key key(EVP_EC_gen("P-256"), &EVP_PKEY_free);
  expect(key != nullptr, "make a key");
  return key;
}

std::string text_of(BIO* memory) {
  char* data = nullptr;
  const long size = BIO_get_mem_data(memory, &data);
  return {data, static_cast<std::size_t>(size)};
}

Certified pem_of(X509* certificate, EVP_PKEY* key) {
  const Memory first(BIO_new(BIO_s_mem()), &BIO_free_all), second(BIO_new(BIO_s_mem()), &BIO_free_all);
  expect(PEM_write_bio_X509(first.get(), certificate) == 1, "write a certificate");
  expect(PEM_write_bio_PrivateKey(second.get(), key, nullptr, nullptr, 0, nullptr, nullptr) == 1, "write a key");
  return {text_of(first.get()), text_of(second.get())};
}

void add_extension(X509* certificate, X509* issuer, int kind, const std::string& value) {
  X509V3_CTX context;
  X509V3_set_ctx_nodb(&context);
  X509V3_set_ctx(&context, issuer, certificate, nullptr, nullptr, 0);
  const std::unique_ptr<X509_EXTENSION, decltype(&X509_EXTENSION_free)> made(
      X509V3_EXT_conf_nid(nullptr, &context, kind, value.c_str()), &X509_EXTENSION_free);
  expect(made != nullptr && X509_add_ext(certificate, made.get(), -1) == 1, "describe a certificate");
}

Certificate new_certificate(const std::string& name, EVP_PKEY* key, int days) {
  constexpr long kDay_s = 86400;
  Certificate certificate(X509_new(), &X509_free);
  expect(certificate != nullptr, "make a certificate");
  X509* const made = certificate.get();
  const std::unique_ptr<BIGNUM, decltype(&BN_free)> serial(BN_new(), &BN_free);
  expect(X509_set_version(made, X509_VERSION_3) == 1 && serial != nullptr &&
             BN_rand(serial.get(), kSerialBits, BN_RAND_TOP_ANY, BN_RAND_BOTTOM_ANY) == 1 &&
             BN_to_ASN1_INTEGER(serial.get(), X509_get_serialNumber(made)) != nullptr &&
             X509_gmtime_adj(X509_getm_notBefore(made), -kDay_s) != nullptr &&  // clocks differ
             X509_gmtime_adj(X509_getm_notAfter(made), kDay_s * days) != nullptr && X509_set_pubkey(made, key) == 1 &&
             X509_NAME_add_entry_by_txt(X509_get_subject_name(made), "CN", MBSTRING_UTF8,
                                        reinterpret_cast<const unsigned char*>(name.c_str()), -1, -1, 0) == 1,
         "fill in a certificate");
  return certificate;
}

bool is_address(const std::string& host) {
  unsigned char bytes[sizeof(in6_addr)];
  return inet_pton(AF_INET, host.c_str(), bytes) == 1 || inet_pton(AF_INET6, host.c_str(), bytes) == 1;
}

bool is_host_name(const std::string& host) {
  constexpr std::size_t kLongest = 253;
  return !host.empty() && host.size() <= kLongest && std::all_of(host.begin(), host.end(), [](unsigned char letter) {
    return std::isalnum(letter) != 0 || letter == '-' || letter == '.' || letter == '*';
  });
}

}  // namespace

Certified make_authority(const std::string& name, int days) {
  const Key key = new_key();
  const Certificate made = new_certificate(name, key.get(), days);
  expect(X509_set_issuer_name(made.get(), X509_get_subject_name(made.get())) == 1, "name an issuer");
  add_extension(made.get(), made.get(), NID_basic_constraints, "critical,CA:TRUE,pathlen:0");
  add_extension(made.get(), made.get(), NID_key_usage, "critical,keyCertSign,cRLSign");
  add_extension(made.get(), made.get(), NID_subject_key_identifier, "hash");
  expect(X509_sign(made.get(), key.get(), EVP_sha256()) > 0, "sign a certificate");
  return pem_of(made.get(), key.get());
}

Certified make_server_certificate(const Certified& authority, const std::vector<std::string>& hosts, int days) {
  const Memory first(BIO_new_mem_buf(authority.certificate.data(), static_cast<int>(authority.certificate.size())),
                     &BIO_free_all),
      second(BIO_new_mem_buf(authority.key.data(), static_cast<int>(authority.key.size())), &BIO_free_all);
  const Certificate issuer(PEM_read_bio_X509(first.get(), nullptr, nullptr, nullptr), &X509_free);
  const Key issuer_key(PEM_read_bio_PrivateKey(second.get(), nullptr, nullptr, nullptr), &EVP_PKEY_free);
  if (issuer == nullptr || issuer_key == nullptr || X509_check_private_key(issuer.get(), issuer_key.get()) != 1)
    throw Error(ErrorCode::kBadInput, "this is no authority's certificate with its key", {},
                "begin another folder of keys");
  std::string names;
  for (const std::string& host : hosts) {
    if (!is_address(host) && !is_host_name(host))
      throw Error(ErrorCode::kBadInput, "'" + host + "' is neither a host's name nor an IP address", {},
                  "name the machine of the broker as programs reach it");
    names += (names.empty() ? "" : ",") + std::string(is_address(host) ? "IP:" : "DNS:") + host;
  }
  MAPWEAVE_EXPECT(!names.empty(), "a server has a name");
  const Key key = new_key();
  const Certificate made = new_certificate(hosts.front(), key.get(), days);
  expect(X509_set_issuer_name(made.get(), X509_get_subject_name(issuer.get())) == 1, "name an issuer");
  add_extension(made.get(), issuer.get(), NID_basic_constraints, "critical,CA:FALSE");
  add_extension(made.get(), issuer.get(), NID_key_usage, "critical,digitalSignature");
  add_extension(made.get(), issuer.get(), NID_ext_key_usage, "serverAuth");
  add_extension(made.get(), issuer.get(), NID_authority_key_identifier, "keyid");
  add_extension(made.get(), issuer.get(), NID_subject_alt_name, names);
  expect(X509_sign(made.get(), issuer_key.get(), EVP_sha256()) > 0, "sign a certificate");
  return pem_of(made.get(), key.get());
}

std::string random_password() {
  constexpr std::size_t kBytes = 16;
  unsigned char bytes[kBytes];
  expect(RAND_bytes(bytes, kBytes) == 1, "make random numbers");
  return to_hex(std::string_view(reinterpret_cast<const char*>(bytes), kBytes));
}

}  // namespace mapweave::transport
