#include "server_state.h"

#include <mapweave/core/stamped_pose.h>
#include <mapweave/matching/alignment_search.h>

#include <algorithm>
#include <cmath>

namespace mapweave::tiers {
namespace {

constexpr std::size_t kLeastReported = 60;  // landmarks with a place, however narrow the wire
constexpr double kAround_s = 0.5;        // from where a rig camera said it was to when its robot's place is asked for
constexpr double kBetweenViews_s = 1.5;  // that show how the robot moved
constexpr double kFarthest = 2.0;        // times the motion between two views, that is extrapolated

struct Whereabouts {
  MapId map;
  Pose3 map_from_robot;
  double apart_s;  // of the nearest view
};

// Between two views, or on from the last two as before.
std::optional<Whereabouts> robot_at(const std::deque<ClientView>& views, Stamp when) {
  const auto apart_s = [&](const ClientView& view) { return std::abs(seconds_between(view.stamp, when)); };
  const auto nearest = std::min_element(
      views.begin(), views.end(), [&](const ClientView& a, const ClientView& b) { return apart_s(a) < apart_s(b); });
  if (nearest == views.end()) return std::nullopt;
  Whereabouts result{nearest->map, nearest->map_from_robot, apart_s(*nearest)};
  const ClientView* before = nearest == views.begin() ? nullptr : &*std::prev(nearest);
  const ClientView* after = std::next(nearest) == views.end() ? nullptr : &*std::next(nearest);
  if (nearest->stamp <= when) std::swap(before, after);
  for (const ClientView* other : {before, after}) {
    if (other == nullptr || other->map != nearest->map) continue;
    const double span_s = seconds_between(nearest->stamp, other->stamp),
                 share = seconds_between(nearest->stamp, when) / span_s;
    if (std::abs(span_s) > kBetweenViews_s || std::abs(share) > kFarthest) continue;
    result.map_from_robot = interpolated(nearest->map_from_robot, other->map_from_robot, share);
    return result;
  }
  return result;
}

}  // namespace

struct VisualServer::PlaceSearch::State {
  PlaceRequest request;
  std::shared_ptr<const TeamView> view;
  fusion::FusionOptions options;
  std::set<RobotId> refused;  // whose keyframes say nothing of where the client is
  std::optional<fusion::FoundPlace> found;
  const TeamView::Component* component = nullptr;  // where
};

VisualServer::PlaceSearch::PlaceSearch(std::unique_ptr<State> state) : state_(std::move(state)) {}
VisualServer::PlaceSearch::~PlaceSearch() = default;

void VisualServer::PlaceSearch::run(WorkerPool& pool) {
  for (const TeamView::Component& one : state_->view->components()) {
    auto found =
        one.places(state_->options.visual.vocabulary, pool).find(state_->request.features, state_->options, pool);
    if (!found || (state_->found && found->probability <= state_->found->probability)) continue;
    if (state_->refused.count(found->keyframe.session.client.robot) != 0) continue;
    one.make_landmarks(pool);
    state_->found = std::move(found);
    state_->component = &one;
  }
}

std::shared_ptr<VisualServer::PlaceSearch> VisualServer::place_search(const SessionId& from,
                                                                      PlaceRequest request) const {
  const State& state = *state_;
  state_->client(from);
  if (state.options.share == Sharing::none || !state.view) return nullptr;
  auto search = std::make_unique<PlaceSearch::State>();
  search->request = std::move(request);
  search->view = state.view;
  search->options = state.fusion_options;
  for (const auto& [one, other] : state.refused) {
    if (one == from.client.robot) search->refused.insert(other);
    if (other == from.client.robot) search->refused.insert(one);
  }
  return std::shared_ptr<PlaceSearch>(new PlaceSearch(std::move(search)));
}

std::optional<PlaceAnswer> VisualServer::place(const SessionId& from, const PlaceRequest& request,
                                               WorkerPool& pool) const {
  const auto search = place_search(from, request);
  if (!search) return std::nullopt;
  search->run(pool);
  return answer(from, *search);
}

std::optional<VisualServer::State::RobotPlace> VisualServer::State::place_by_rig_camera(const SessionId& camera,
                                                                                        Stamp when,
                                                                                        const TeamView& team) const {
  if (!rig.enabled) return std::nullopt;
  std::optional<RobotPlace> best;
  double least_s = std::nextafter(kAround_s, 1.0);
  for (const Entry* entry : rig_cameras(camera.client)) {
    const Client& rig_camera = entry->second;
    const std::optional<Whereabouts> known = robot_at(rig_camera.seen_at, when);
    if (!known || !(known->apart_s < least_s)) continue;
    if (auto place = in_team(team, rig_camera, known->map, known->map_from_robot)) {
      best = std::move(place);
      least_s = known->apart_s;
    }
  }
  return best;
}

std::optional<PlaceAnswer> VisualServer::answer(const SessionId& from, const PlaceSearch& search) const {
  State& state = *state_;
  Client& client = state.client(from);
  const PlaceRequest& request = search.state_->request;
  const TeamView& view = *search.state_->view;
  const auto place = search.state_->found
                         ? State::RobotPlace{search.state_->component, search.state_->found->map_from_robot,
                                             search.state_->found->keyframe}
                         : state.place_by_rig_camera(from, request.stamp, view);
  if (!place) return std::nullopt;
  const auto answer_in = [&](const MapId& client_map, const Node& near,
                             const TeamView::Member& member) -> std::optional<PlaceAnswer> {
    const Sim3 team_from_map = team_from_map_at(near.id, near.map_from_node, member),
               map_from_team = inverse(team_from_map);
    PlaceAnswer answer;
    answer.stamp = request.stamp;
    answer.map = client_map;
    answer.map_from_robot =
        carried(map_from_team, place->team_from_robot, keyframe_of(near)->geometry->robot_from_camera);
    // Those of others, and its own that it has forgotten.
    const auto add_from = [&](const matching::LandmarkIndex& index, bool is_own) {
      for (const DescribedLandmark& one :
           index.retrieve(state.frustum(*request.features.geometry, place->team_from_robot), state.options.retrieval)) {
        DescribedLandmark here = matching::transformed(one, map_from_team);
        if ((here.id.session == from) == is_own && matching::problem_with(here).empty())
          answer.landmarks.push_back(std::move(here));
      }
    };
    add_from(place->component->landmarks(), false);
    if (const auto* forgotten = place->component->forgotten()) {
      add_from(*forgotten, true);
      std::sort(answer.landmarks.begin(), answer.landmarks.end(),
                [](const DescribedLandmark& a, const DescribedLandmark& b) { return a.id < b.id; });
    }
    if (answer.landmarks.empty()) return std::nullopt;
    if (state.options.most_bytes_per_s > 0.0) {
      client.downlink.wait_until(answer.stamp, state.options.most_bytes_per_s);
      answer.landmarks =
          thinned(std::move(answer.landmarks), std::max(kLeastReported, landmarks_within(client.downlink)));
      client.downlink.spend(encode(answer).size());
    }
    return answer;
  };
  // In a map of its own where one lies there, else in that of who saw the place.
  for (const auto& [client_map, part] : client.parts) {
    const TeamView::Member* member = view.member(part.name);
    if (member == nullptr || member->component != place->component) continue;
    const Node* near = State::nearest(part, *member, place->team_from_robot.t, State::Frame::team);
    if (near != nullptr) return answer_in(client_map, *near, *member);
  }
  for (const auto& [name, map] : state.starts) {
    const TeamView::Member* member = view.member(name);
    const Node* near = map->nodes.find(place->beside);
    if (member != nullptr && member->component == place->component && near != nullptr)
      return answer_in(name, *near, *member);
  }
  const auto owner = state.clients.find(place->beside.session);
  if (owner == state.clients.end()) return std::nullopt;
  for (const auto& [client_map, part] : owner->second.parts) {
    const TeamView::Member* member = view.member(part.name);
    const Node* near = part.inbox.map().nodes.find(place->beside);
    if (member != nullptr && member->component == place->component && near != nullptr)
      return answer_in(part.name, *near, *member);
  }
  return std::nullopt;
}

}  // namespace mapweave::tiers
