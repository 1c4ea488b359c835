// What robots and the servers of their maps say to each other while they map.

#include "fuzz_target.h"

#include <maps/messages.h>

namespace mapweave::fuzz {
namespace {

KeyframeFeatures some_features() { return std::get<KeyframeFeatures>(*test::of_a_client(1, 20).nodes.front().payload); }

StreamEnd some_end() {
  StreamEnd end{Error(ErrorCode::kCorrupt, "cut short", "a.rawlog", "copy it again"), {"a note"}, "a.rawlog", {}};
  end.log_sha256 = test::hash_of(3);
  return end;
}

const std::vector<Kind>& kinds() {
  static const std::vector<Kind> all = {
      {round_trip(decode_hello), {encode(Hello{test::kAlphaCamera, test::hash_of(1)})}},
      {round_trip(decode_client_view), {encode(ClientView{MapId("alpha.camera"), {7}, {}, 1, 20, 3, 4})}},
      {round_trip(decode_place_request), {encode(PlaceRequest{{8}, some_features()})}},
      {round_trip(decode_place_answer), {encode(PlaceAnswer{{8}, MapId("beta.camera"), {}, test::share().landmarks})}},
      {round_trip(decode_share), {encode(test::share()), encode(test::global_share())}},
      {round_trip(decode_sensed),
       {encode(test::sensed(test::small_scan())), encode(test::sensed(some_end())),
        encode(test::sensed(Pose3{{1.0, 2.0, 0.0}, Eigen::Quaterniond::Identity()})),
        encode(test::sensed(InertialYaw{-7.25})), encode(test::sensed(LostScan{})),
        encode(test::sensed(MappedPart{true, true, "some bytes"}))}}};
  return all;
}

}  // namespace

std::vector<std::string> seeds() { return seeds_of(kinds()); }
void decode(std::string_view bytes) { decode_one_of(kinds(), bytes); }

}  // namespace mapweave::fuzz
