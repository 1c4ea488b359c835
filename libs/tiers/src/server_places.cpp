#include "server_state.h"

#include <mapweave/matching/alignment_search.h>

#include <algorithm>

namespace mapweave::tiers {
namespace {

constexpr std::size_t kLeastTold = 60;  // landmarks with a place, however narrow the wire

}  // namespace

struct VisualServer::PlaceSearch::State {
  PlaceRequest request;
  std::shared_ptr<const TeamView> view;
  fusion::FusionOptions options;
  std::optional<fusion::FoundPlace> found;
  const TeamView::Component* component = nullptr;  // where
};

VisualServer::PlaceSearch::PlaceSearch(std::unique_ptr<State> state) : state_(std::move(state)) {}
VisualServer::PlaceSearch::~PlaceSearch() = default;

void VisualServer::PlaceSearch::run(WorkerPool& pool) {
  for (const TeamView::Component& one : state_->view->components()) {
    auto found = one.places.find(state_->request.features, state_->options, pool);
    if (!found || (state_->found && found->probability <= state_->found->probability)) continue;
    state_->found = std::move(found), state_->component = &one;
  }
}

std::shared_ptr<VisualServer::PlaceSearch> VisualServer::place_search(const SessionId& from, PlaceRequest request) const {
  const State& state = *state_;
  state_->client(from);
  if (state.options.share == Sharing::none || !state.view) return nullptr;
  auto search = std::make_unique<PlaceSearch::State>();
  search->request = std::move(request), search->view = state.view, search->options = state.fusion_options;
  return std::shared_ptr<PlaceSearch>(new PlaceSearch(std::move(search)));
}

std::optional<PlaceAnswer> VisualServer::place(const SessionId& from, const PlaceRequest& request, WorkerPool& pool) const {
  const auto search = place_search(from, request);
  if (!search) return std::nullopt;
  search->run(pool);
  return answer(from, *search);
}

std::optional<PlaceAnswer> VisualServer::answer(const SessionId& from, const PlaceSearch& search) const {
  State& state = *state_;
  Client& client = state.client(from);
  const auto& [request, view, fusion_options, best, component] = *search.state_;
  if (!best) return std::nullopt;
  const auto answer_in = [&, &request = request, &best = best, &component = component](
                             const MapId& told, const Node& near, const TeamView::Member& member) -> std::optional<PlaceAnswer> {
    const Sim3 team_from_map = team_from_map_at(near.id, near.map_from_node, member), map_from_team = matching::inverse(team_from_map);
    PlaceAnswer answer;
    answer.stamp = request.stamp, answer.map = told;
    answer.map_from_robot = carried(map_from_team, best->map_from_robot);
    for (const DescribedLandmark& one :
         component->landmarks.retrieve(state.frustum(*request.features.geometry, best->map_from_robot), state.options.retrieval)) {
      DescribedLandmark here = matching::transformed(one, map_from_team);
      if (here.id.session != from && matching::flaw(here).empty()) answer.landmarks.push_back(std::move(here));
    }
    if (answer.landmarks.empty()) return std::nullopt;
    if (state.options.most_bytes_per_s > 0.0) {
      client.downlink.wait_until(answer.stamp, state.options.most_bytes_per_s);
      answer.landmarks = thinned(std::move(answer.landmarks), std::max(kLeastTold, landmarks_within(client.downlink)));
      client.downlink.spend(encode(answer).size());
    }
    return answer;
  };
  // In a map of its own where one lies there, else in that of who saw the place.
  for (const auto& [told, part] : client.parts) {
    const TeamView::Member* member = view->member(part.name);
    if (member == nullptr || member->component != component) continue;
    const Node* near = State::nearest(part, *member, best->map_from_robot.t, State::Frame::team);
    if (near != nullptr) return answer_in(told, *near, *member);
  }
  const auto owner = state.clients.find(best->keyframe.session);
  if (owner == state.clients.end()) return std::nullopt;
  for (const auto& [told, part] : owner->second.parts) {
    const TeamView::Member* member = view->member(part.name);
    const Node* near = part.inbox.map().nodes.find(best->keyframe);
    if (member != nullptr && member->component == component && near != nullptr) return answer_in(part.name, *near, *member);
  }
  return std::nullopt;
}

}  // namespace mapweave::tiers
