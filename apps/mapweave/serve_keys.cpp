// mapweave serve keys: certificates, users and passwords, so that a deployment's broker can be reached over a network.

#include "serve.h"

#include <mapweave/core/error.h>
#include <mapweave/core/files.h>
#include <mapweave/core/format.h>
#include <mapweave/runtime/deployment_keys.h>
#include <mapweave/transport/certificates.h>

#include <sys/stat.h>

#include <iostream>

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

transport::Certified authority_in(const fs::path& folder) {
  const fs::path certificate = folder / "authority.pem", key = folder / "authority.key";
  std::error_code ignored;
  if (fs::exists(key, ignored)) return {read_file(certificate), read_file(key)};
  transport::Certified made = transport::make_authority("mapweave deployment", kAuthorityDays);
  write_file(certificate, made.certificate);
  write_file(key, made.key);
  return made;
}

}  // namespace

ExitCode make_keys(const Deployment& deployment, const KeysArguments& arguments) {
  const PrivateFiles only_for_us;
  const fs::path& folder = arguments.out;
  std::error_code error;
  fs::create_directories(folder, error);
  if (error)
    throw Error(ErrorCode::kCannotWrite, "the folder for keys cannot be made: " + error.message(), folder.string(),
                "name another one in --out");
  const transport::Certified authority = authority_in(folder);
  std::vector<std::string> hosts = arguments.hosts;
  hosts.insert(hosts.end(), {"localhost", "127.0.0.1"});
  const transport::Certified broker = transport::make_server_certificate(authority, hosts, kBrokerDays);
  write_file(folder / "broker.pem", broker.certificate);
  write_file(folder / "broker.key", broker.key);
  transport::BrokerOptions options;
  options.folder = ".";
  options.host = "0.0.0.0";
  options.port = arguments.port;
  options.certificate = "broker.pem";
  options.key = "broker.key";
  options.users = runtime::users_of(deployment.plan, is_coordinated(deployment));
  std::size_t kept = 0;
  for (transport::BrokerUser& user : options.users) {
    const fs::path file = folder / (user.name + ".keys");
    if (fs::exists(file, error)) {
      user.password = runtime::read_program_keys(file).password;
      ++kept;
      continue;
    }
    user.password = transport::random_password();
    write_file(file, runtime::encode({user.name, user.password, authority.certificate}));
  }
  write_file(folder / "broker.conf", transport::broker_configuration(options));
  std::cout << options.users.size() << " users"
            << (kept > 0 ? ", " + std::to_string(kept) + " of them known before" : "")
            << ": each program's file is NAME.keys; its machine gets that file, and live.keys names it\n"
            << "broker: copy broker.conf, broker.pem and broker.key to a folder on " << hosts.front()
            << ", and there: nats-server -c broker.conf\n"
            << "programs: live.broker: nats://" << hosts.front() << ":" << arguments.port << "\n"
            << "authority.key signs brokers' certificates: keep it here\n"
            << "keys: " << folder.string() << "\n";
  return ExitCode::done;
}

}  // namespace mapweave::app
