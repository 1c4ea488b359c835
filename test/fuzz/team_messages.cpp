// What edges, cloud, coordinator and helper processes say to each other of maps.

#include "fuzz_target.h"

#include <maps/messages.h>

#include <mapweave/maps/mapper_messages.h>

namespace mapweave::fuzz {
namespace {

Judgement some_judgement() { return test::RandomMaps(5).judgement({test::kAlphaLaser, 0}, {test::kBetaLaser, 3}); }

std::vector<Kind> verdicts_and_judgements() {
  return {{round_trip(decode_judgement), {encode(some_judgement())}},
          {round_trip(decode_verdict), {encode(test::RandomMaps(6).verdict(MapId("alpha"), MapId("beta")))}},
          {round_trip(decode_pairs_to_judge), {encode(test::some_pairs())}},
          {round_trip(decode_merged_maps), {encode(test::merged_maps())}},
          {round_trip(decode_receipts), {encode(test::some_receipts())}},
          {round_trip(decode_refusal), {encode(Refusal{Error(ErrorCode::kBadInput, "what", "where", "remedy")})}}};
}

std::vector<Kind> events_and_mappers() {
  const MapSummary summary = test::small_report().summary;
  const std::vector<CoordinatorEvent> events = {
      test::small_report(),       RobotComes{RobotId("beta"), summary, TierId("north")},
      RobotGoes{RobotId("beta")}, EdgeIs{TierId("north"), 1e6, 0.5, 3, 0.01},
      EdgeGoes{TierId("north")},  LinkIs{RobotId("beta"), TierId("north"), 1e5, 0.02}};
  std::vector<std::string> event_seeds;
  for (const CoordinatorEvent& event : events) event_seeds.push_back(encode(event));
  return {
      {round_trip(decode_coordinator_event), event_seeds},
      {round_trip(decode_robot_move), {encode(RobotMove{RobotId("beta"), TierId("north"), TierId()})}},
      {round_trip(decode_mapper_input),
       {encode(MapperInput(EngineStart{"rbpf", {{"particles", 4.0}, {"shrink", 0.8}}})),
        encode(MapperInput(test::sensed(test::small_scan()))), encode(MapperInput(PosesWanted{}))}},
      {round_trip(decode_mapper_output),
       {encode(MapperOutput(MapperProgress{57})), encode(MapperOutput(ScanPoses{{{{1, 2, 3}, {4, 5, 6}, true}}, true})),
        encode(MapperOutput(Refusal{Error(ErrorCode::kHelperFailed, "memory_limit_mb reached")}))}}};
}

const std::vector<Kind>& kinds() {
  static const std::vector<Kind> all = [] {
    std::vector<Kind> made = verdicts_and_judgements();
    for (Kind& kind : events_and_mappers()) made.push_back(std::move(kind));
    return made;
  }();
  return all;
}

}  // namespace

std::vector<std::string> seeds() { return seeds_of(kinds()); }
void decode(std::string_view bytes) { decode_one_of(kinds(), bytes); }

}  // namespace mapweave::fuzz
