// mapweave serve keys: certificates, users and passwords, so that a deployment's broker can be reached over a network.

#include "serve.h"

#include <mapweave/core/error.h>
#include <mapweave/core/files.h>
#include <mapweave/core/format.h>
#include <mapweave/runtime/deployment_keys.h>
#include <mapweave/runtime/nats_wires.h>
#include <mapweave/transport/certificates.h>

#include <sys/stat.h>

#include <algorithm>
#include <iostream>
#include <set>

namespace mapweave::app {
namespace {

namespace fs = std::filesystem;

constexpr int kAuthorityDays = 3650, kBrokerDays = 1825;

// Files that only their owner can read, from here on.
class PrivateFiles {
 public:
  PrivateFiles() : before_(::umask(S_IRWXG | S_IRWXO)) {}
  ~PrivateFiles() { ::umask(before_); }
  PrivateFiles(const PrivateFiles&) = delete;
  PrivateFiles& operator=(const PrivateFiles&) = delete;

 private:
  mode_t before_;
};

void make_folder_for_keys(const fs::path& folder) {
  make_folder(folder, "name another one in --out", "the folder for keys cannot be made");
}

transport::Certified authority_in(const fs::path& folder) {
  const fs::path certificate = folder / "authority.pem", key = folder / "authority.key";
  std::error_code ignored;
  if (fs::exists(key, ignored)) return {read_file(certificate), read_file(key)};
  transport::Certified made = transport::make_authority("mapweave deployment", kAuthorityDays);
  write_file(certificate, made.certificate);
  write_file(key, made.key);
  return made;
}

// The user's password, as the folder has it; else a new one, which it keeps. True: it had it.
bool give_password(transport::BrokerUser& user, const fs::path& folder, const transport::Certified& authority) {
  const fs::path file = folder / (user.name + ".keys");
  std::error_code ignored;
  const bool is_known = fs::exists(file, ignored);
  user.password = is_known ? runtime::read_program_keys(file).password : transport::random_password();
  if (!is_known) write_file(file, runtime::encode({user.name, user.password, authority.certificate}));
  return is_known;
}

// Host and port of "nats://host:port".
std::pair<std::string, int> address_of(const runtime::EdgeEntry& edge) {
  const std::size_t scheme = edge.broker.find("://"), begin = scheme == std::string::npos ? 0 : scheme + 3;
  const std::size_t colon = edge.broker.rfind(':');
  const std::string port = colon == std::string::npos || colon < begin ? "" : edge.broker.substr(colon + 1);
  const bool is_number = !port.empty() && port.size() < 6 && port.find_first_not_of("0123456789") == std::string::npos;
  const int number = is_number ? std::stoi(port) : 0;
  if (number < 1 || number > 65535 || colon == begin)
    throw Error(ErrorCode::kBadInput, "the broker of edge '" + edge.id + "' has no address", edge.broker,
                "write it as in nats://10.0.0.2:4222");
  return {edge.broker.substr(begin, colon - begin), number};
}

// What a server in this folder shows of itself, into the folder.
transport::BrokerOptions broker_in(const fs::path& folder, const transport::Certified& authority,
                                   std::vector<std::string> hosts, int port) {
  make_folder_for_keys(folder);
  hosts.insert(hosts.end(), {"localhost", "127.0.0.1"});
  const transport::Certified broker = transport::make_server_certificate(authority, hosts, kBrokerDays);
  write_file(folder / "broker.pem", broker.certificate);
  write_file(folder / "broker.key", broker.key);
  transport::BrokerOptions options;
  options.folder = ".";
  options.host = "0.0.0.0";
  options.port = port;
  options.certificate = "broker.pem";
  options.key = "broker.key";
  return options;
}

std::string password_of(const std::vector<transport::BrokerUser>& users, const std::string& name) {
  const auto user = std::find_if(users.begin(), users.end(), [&](const auto& one) { return one.name == name; });
  MAPWEAVE_EXPECT(user != users.end(), "the broker knows an edge's own one");
  return user->password;
}

}  // namespace

ExitCode make_keys(const Deployment& deployment, const KeysArguments& arguments) {
  const PrivateFiles only_for_us;
  const fs::path& folder = arguments.out;
  const runtime::RunConfiguration& configuration = deployment.loaded.configuration;
  make_folder_for_keys(folder);
  const transport::Certified authority = authority_in(folder);
  std::set<std::string> users, kept;
  const auto give_passwords = [&](std::vector<transport::BrokerUser> all) {
    for (transport::BrokerUser& user : all)
      if (give_password(user, folder, authority) && users.count(user.name) == 0) kept.insert(user.name);
    for (const transport::BrokerUser& user : all) users.insert(user.name);
    return all;
  };
  transport::BrokerOptions hub = broker_in(folder, authority, arguments.hosts, arguments.port);
  hub.most_store_bytes = std::max(hub.most_store_bytes, runtime::store_bytes(configuration, deployment.plan));
  hub.users = give_passwords(runtime::users_of(configuration, deployment.plan));
  std::string leaves;
  for (const TierId& id : deployment.plan.edges) {
    const runtime::EdgeEntry edge = runtime::edge_entry(configuration, id);
    if (edge.broker.empty()) continue;
    hub.domain = runtime::kHubDomain;
    hub.leaf_port = arguments.leaf_port;
    const std::string name = runtime::leaf_user_of(id), password = password_of(hub.users, name);
    const auto [host, port] = address_of(edge);
    const fs::path own = folder / ("broker-of-" + id.str());
    transport::BrokerOptions leaf = broker_in(own, authority, {host}, port);
    write_file(own / "authority.pem", authority.certificate);
    leaf.hub_ca = "authority.pem";
    leaf.most_store_bytes = hub.most_store_bytes;
    leaf.domain = runtime::domain_of(edge);
    leaf.hubs = {"tls://" + name + ":" + password + "@" + arguments.hosts.front() + ":" +
                 std::to_string(arguments.leaf_port)};
    leaf.users = give_passwords(runtime::users_of(configuration, deployment.plan, id));
    write_file(own / "broker.conf", transport::broker_configuration(leaf));
    leaves += "broker of edge " + id.str() + ": copy " + own.filename().string() + " to " + host +
              ", and in it: nats-server -c broker.conf\n";
  }
  write_file(folder / "broker.conf", transport::broker_configuration(hub));
  std::cout << users.size() << " users"
            << (kept.empty() ? "" : ", " + std::to_string(kept.size()) + " of them known before")
            << ": each program's file is NAME.keys; its machine gets that file, and live.keys names it\n"
            << "broker: copy broker.conf, broker.pem and broker.key to a folder on " << arguments.hosts.front()
            << ", and there: nats-server -c broker.conf\n"
            << leaves << "programs: live.broker: nats://" << arguments.hosts.front() << ":" << arguments.port << "\n"
            << "authority.key signs brokers' certificates: keep it here\n"
            << "keys: " << folder.string() << "\n";
  return ExitCode::done;
}

}  // namespace mapweave::app
