#include "exchange_form.h"
#include "soundness.h"

#include <mapweave/maps/pair_to_judge.h>

#include <cmath>

namespace mapweave {
namespace {

bool is_sound(const SubmapsToJudge& pair) {
  const Pose2& middle = pair.a_from_b;
  return std::isfinite(middle.x) && std::isfinite(middle.y) && std::isfinite(middle.phi) &&
         std::isfinite(pair.radius_m) && pair.radius_m >= 0.0 && std::isfinite(pair.yaw_rad) && pair.yaw_rad >= 0.0;
}

SessionTable sessions_of(const std::vector<PairToJudge>& pairs) {
  SessionTable sessions;
  for (const PairToJudge& pair : pairs)
    for (const SubmapsToJudge& submaps : pair.submaps)
      for (const SessionId& session : {submaps.a.session, submaps.b.session}) {
        MAPWEAVE_EXPECT(problem_with(session).empty(), "only sound values are sent: " + problem_with(session));
        sessions.add(session);
      }
  sessions.sort();
  return sessions;
}

}  // namespace

std::string encode(const std::vector<PairToJudge>& pairs) {
  const SessionTable sessions = sessions_of(pairs);
  form::Exchange form;
  form.mutable_judging_task();
  for (const PairToJudge& pair : pairs) {
    expect_name(pair.a, "map");
    expect_name(pair.b, "map");
    auto& line = *form.mutable_judging_task()->add_pairs();
    line.set_a(pair.a.str());
    line.set_b(pair.b.str());
    line.set_have_cameras(pair.have_cameras);
    for (const SubmapsToJudge& submaps : pair.submaps) {
      MAPWEAVE_EXPECT(is_sound(submaps), "a window is where and how wide");
      auto& window = *line.add_submaps();
      *window.mutable_a() = form_of(submaps.a, sessions);
      *window.mutable_b() = form_of(submaps.b, sessions);
      window.set_x(submaps.a_from_b.x);
      window.set_y(submaps.a_from_b.y);
      window.set_yaw(submaps.a_from_b.phi);
      window.set_radius_m(submaps.radius_m);
      window.set_yaw_rad(submaps.yaw_rad);
      window.set_known_part(submaps.known_part);
    }
  }
  return written(form, sessions);
}

std::vector<PairToJudge> decode_pairs_to_judge(std::string_view bytes, const std::string& where) {
  FormReader reader(where);
  const auto form = read_exchange(bytes, reader, where, form::Exchange::kJudgingTask);
  std::vector<PairToJudge> pairs;
  for (const auto& line : form.judging_task().pairs()) {
    PairToJudge pair{name_in<MapId>(line.a(), "map", reader), name_in<MapId>(line.b(), "map", reader), {}, false};
    pair.have_cameras = line.have_cameras();
    for (const auto& window : line.submaps()) {
      pair.submaps.push_back({reader.submap_id(window.a()),
                              reader.submap_id(window.b()),
                              {window.x(), window.y(), window.yaw()},
                              window.radius_m(),
                              window.yaw_rad(),
                              window.known_part()});
      if (!is_sound(pair.submaps.back())) reader.corrupt("a window that is nowhere, or of no width");
    }
    pairs.push_back(std::move(pair));
  }
  return pairs;
}

}  // namespace mapweave
