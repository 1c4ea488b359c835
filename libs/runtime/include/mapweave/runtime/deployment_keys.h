#pragma once
// Who may do what at the broker of a deployment: a user for each robot, each edge and the cloud. A robot publishes on
// its own subjects only, an edge on its own and those of its robots; only edges, the cloud and a coordinator make
// streams.

#include <mapweave/runtime/run_configuration.h>
#include <mapweave/transport/broker.h>

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace mapweave::runtime {

// What a program needs to be let in: the content of the file that `live.keys` names.
struct ProgramKeys {
  std::string user, password;
  std::string authority;  // PEM: the certificate that the broker's must be signed by
};

// The keys as JSON.
std::string encode(const ProgramKeys& keys);
// Throws Error: what read_file() throws, and kBadInput for what is no such file.
ProgramKeys read_program_keys(const std::filesystem::path& file);

// "robot-alpha", "edge-north", "cloud", "doctor", without passwords: of live.broker, or of the own broker of an edge;
// with a coordinator, which may give any robot to any edge, "coordinator", too. Of live.broker also leaf_user_of()
// edges with brokers of their own.
std::vector<transport::BrokerUser> users_of(const RunConfiguration& configuration, const RunPlan& plan,
                                            const std::optional<TierId>& at_broker_of = {});
std::string leaf_user_of(const TierId& edge);
// Under which name an edge says to the coordinator what its maps show, beside its own.
std::string maps_word_of(const TierId& edge);
// What the subjects begin with on which a user receives answers, and nobody else.
std::string inbox_of(const std::string& user);

}  // namespace mapweave::runtime
