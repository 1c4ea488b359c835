#include <mapweave/core/error.h>
#include <mapweave/matching/place_index.h>

#include <algorithm>

namespace mapweave::matching {
namespace {

constexpr std::uint32_t kBlock = 65536;  // slots, so that a slot's number in its block fits 16 bits
constexpr std::size_t kFewDead = 64;     // that are left, so that small indexes are not rebuilt again and again

void expect_bag(const BagOfWords& bag, std::size_t words) {
  int sum = 0;
  for (std::size_t i = 0; i < bag.size(); ++i) {
    MAPWEAVE_EXPECT(bag[i].word < words, "a word of another vocabulary");
    MAPWEAVE_EXPECT(i == 0 || bag[i - 1].word < bag[i].word, "the words of a bag rise");
    sum += bag[i].share;
  }
  MAPWEAVE_EXPECT(sum <= kWholeBag, "the shares of a bag are those of one whole");
}

bool better(const SimilarPlace& a, const SimilarPlace& b) {
  return a.score != b.score ? a.score > b.score : a.id < b.id;
}

}  // namespace

PlaceIndex::PlaceIndex(std::size_t words) : words_(words) {}

void PlaceIndex::append(std::uint32_t slot, const BagOfWords& bag) {
  if (slot / kBlock == blocks_.size()) blocks_.push_back({std::vector<std::vector<Posting>>(words_)});
  auto& postings = blocks_[slot / kBlock].postings;
  for (const WordShare& entry : bag)
    postings[entry.word].push_back({static_cast<std::uint16_t>(slot % kBlock), entry.share});
}

void PlaceIndex::add(const NodeId& id, const BagOfWords& bag) {
  MAPWEAVE_EXPECT(!contains(id), "a keyframe is added once");
  expect_bag(bag, words_);
  const auto slot = static_cast<std::uint32_t>(id_of_slot_.size());
  append(slot, bag);
  slots_.set(id, slot);
  id_of_slot_.push_back(id);
  alive_.push_back(true);
}

bool PlaceIndex::remove(const NodeId& id) {
  const std::uint32_t* slot = slots_.find(id);
  if (slot == nullptr) return false;
  alive_[*slot] = false;
  slots_.erase(id);
  if (id_of_slot_.size() > kFewDead + slots_.size() + slots_.size() / 4) compact();
  return true;
}

// Postings of those removed go; done so seldom that each removal pays for itself.
void PlaceIndex::compact() {
  std::vector<std::uint32_t> moved(id_of_slot_.size());
  std::vector<NodeId> ids;
  ids.reserve(slots_.size());
  for (std::size_t slot = 0; slot < id_of_slot_.size(); ++slot) {
    moved[slot] = static_cast<std::uint32_t>(ids.size());
    if (alive_[slot]) ids.push_back(id_of_slot_[slot]);
  }
  std::vector<Block> blocks((ids.size() + kBlock - 1) / kBlock);
  for (Block& block : blocks) block.postings.resize(words_);
  for (std::size_t word = 0; word < words_; ++word)
    for (std::size_t b = 0; b < blocks_.size(); ++b) {
      for (const Posting& posting : blocks_[b].postings[word]) {
        const std::size_t slot = b * kBlock + posting.slot;
        if (alive_[slot])
          blocks[moved[slot] / kBlock].postings[word].push_back(
              {static_cast<std::uint16_t>(moved[slot] % kBlock), posting.share});
      }
      std::vector<Posting>().swap(blocks_[b].postings[word]);
    }
  for (auto& [id, slot] : slots_) slot = moved[slot];
  blocks_ = std::move(blocks);
  id_of_slot_ = std::move(ids);
  alive_.assign(id_of_slot_.size(), true);
}

std::size_t PlaceIndex::bytes() const {
  std::size_t sum = slots_.size() * sizeof(std::pair<NodeId, std::uint32_t>) + id_of_slot_.capacity() * sizeof(NodeId);
  for (const Block& block : blocks_) {
    sum += block.postings.capacity() * sizeof(std::vector<Posting>);
    for (const auto& postings : block.postings) sum += postings.capacity() * sizeof(Posting);
  }
  return sum;
}

void PlaceIndex::accumulate(const std::vector<Posting>& postings, std::uint16_t share, std::uint16_t* scores) {
  // Four at a time: a keyframe stands in a list once, so that no score waits for another.
  const Posting* posting = postings.data();
  const Posting* const end = posting + postings.size();
  const auto sum = [&](const Posting& p) {
    return static_cast<std::uint16_t>(scores[p.slot] + std::min(share, p.share));
  };
  for (; end - posting >= 4; posting += 4) {
    const std::uint16_t s0 = sum(posting[0]), s1 = sum(posting[1]), s2 = sum(posting[2]), s3 = sum(posting[3]);
    const Posting p0 = posting[0], p1 = posting[1], p2 = posting[2], p3 = posting[3];
    scores[p0.slot] = s0;
    scores[p1.slot] = s1;
    scores[p2.slot] = s2;
    scores[p3.slot] = s3;
  }
  for (; posting != end; ++posting) scores[posting->slot] = sum(*posting);
}

std::vector<SimilarPlace> PlaceIndex::query(const BagOfWords& bag, std::size_t most,
                                            const std::function<bool(const NodeId&)>& excluded, int least_score) const {
  expect_bag(bag, words_);
  std::vector<std::uint16_t> scores(id_of_slot_.size(),
                                    0);  // the shares of a bag add up to kWholeBag, so nothing overflows
  for (std::size_t b = 0; b < blocks_.size(); ++b) {
    std::uint16_t* of_block = scores.data() + b * kBlock;
    for (const WordShare& entry : bag) accumulate(blocks_[b].postings[entry.word], entry.share, of_block);
  }
  // A heap, since few of many are wanted and ids are slow to compare.
  struct Candidate {
    std::uint32_t score, slot;
  };
  std::vector<Candidate> heap;
  const auto least = static_cast<std::uint32_t>(std::max(1, least_score));
  for (std::size_t slot = 0; slot < scores.size(); ++slot)
    if (scores[slot] >= least && alive_[slot]) heap.push_back({scores[slot], static_cast<std::uint32_t>(slot)});
  const auto worse = [this](const Candidate& a, const Candidate& b) {
    return a.score != b.score ? a.score < b.score : id_of_slot_[b.slot] < id_of_slot_[a.slot];
  };
  std::make_heap(heap.begin(), heap.end(), worse);
  std::vector<SimilarPlace> places;
  while (!heap.empty() && places.size() < most) {
    std::pop_heap(heap.begin(), heap.end(), worse);
    const NodeId& id = id_of_slot_[heap.back().slot];
    if (!excluded || !excluded(id)) places.push_back({id, static_cast<int>(heap.back().score)});
    heap.pop_back();
  }
  return places;
}

std::vector<SimilarPlace> best_of_groups(const std::vector<SimilarPlace>& places,
                                         const std::function<std::vector<NodeId>(const NodeId&)>& covisible,
                                         double share_of_best) {
  Table<NodeId, int> score_of;
  for (const SimilarPlace& place : places) score_of.set(place.id, place.score);
  Table<NodeId, int> groups;  // best member, best sum
  int best = 0;
  for (const auto& [id, score] : score_of) {
    SimilarPlace member{id, score};
    int sum = score;
    std::vector<NodeId> others = covisible(id);
    std::sort(others.begin(), others.end());
    others.erase(std::unique(others.begin(), others.end()), others.end());
    for (const NodeId& other : others) {
      const int* found = other == id ? nullptr : score_of.find(other);
      if (found == nullptr) continue;
      sum += *found;
      if (better({other, *found}, member)) member = {other, *found};
    }
    const int* known = groups.find(member.id);
    groups.set(member.id, known == nullptr ? sum : std::max(*known, sum));
    best = std::max(best, sum);
  }
  std::vector<SimilarPlace> answer;
  for (const auto& [id, sum] : groups)
    if (sum >= share_of_best * best) answer.push_back({id, sum});
  std::sort(answer.begin(), answer.end(), better);
  return answer;
}

}  // namespace mapweave::matching
