#include <fcntl.h>
#include <mapweave/core/error.h>
#include <mapweave/core/sqlite_file.h>
#include <mapweave/mapdb/map_store.h>
#include <mapweave/maps/member_update.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <iterator>
#include <tuple>

#include "store_index.h"

namespace mapweave::mapdb {
namespace {

namespace fs = std::filesystem;

// An update holds no more than this, so that memory stays bounded however large a map is.
constexpr std::size_t kMostNodes = 2000;
constexpr std::size_t kMostBytes = std::size_t{8} << 20;  // about
constexpr std::size_t kMostJudgements = 2000;

std::size_t size_of(const Node& node) {
  if (node.payload == nullptr) return 64;
  if (const auto* scan = std::get_if<PackedScan>(node.payload.get())) return 64 + 2 * scan->ranges.size();
  if (const auto* keyframe = std::get_if<KeyframeFeatures>(node.payload.get()))
    return 64 + 40 * keyframe->points.size();
  return 128 + 2 * std::get<OccupancyGrid>(*node.payload).log_odds.size();
}

// Calls take(update) for each of the updates that make up a map, one after the other: nodes, then what speaks of them.
template <class Take>
void for_each_update(const Map& map, const Take& take) {
  MapUpdate update;
  std::size_t bytes = 0;
  const auto finish = [&] {
    update.origin.map = map.id;
    update.base = update.sequence++;
    take(update);
    const std::uint64_t sequence = update.sequence;
    update = {};
    update.sequence = sequence;
    bytes = 0;
  };
  const auto make_room = [&](std::size_t size) {
    if (bytes > 0 && (bytes + size > kMostBytes || update.nodes.size() == kMostNodes)) finish();
    bytes += size;
  };
  for (const auto& [id, node] : map.nodes) {
    make_room(size_of(node));
    update.nodes.push_back(node);
  }
  for (const auto& [id, submap] : map.submaps) {
    make_room(64 * submap.submap_from_node.size());
    update.submaps.push_back(submap);
  }
  for (const auto& [id, constraint] : map.constraints) {
    make_room(192);
    update.constraints.push_back(constraint);
  }
  for (const auto& [id, landmark] : map.landmarks) {
    make_room(32 + 12 * landmark.seen.size());
    update.landmarks.push_back(landmark);
  }
  if (bytes > 0) finish();
}

// What a map holds beside its content.
MapUpdate belief_of(const Map& map) {
  MapUpdate belief;
  belief.origin.map = map.id;
  for (const auto& [id, node] : map.nodes) belief.moved.push_back({id, node.map_from_node});
  for (const auto& [id, submap] : map.submaps) belief.submaps.push_back(submap);
  for (const auto& [id, constraint] : map.constraints) belief.constraints.push_back(constraint);
  for (const auto& [id, landmark] : map.landmarks) belief.landmarks.push_back(landmark);
  return belief;
}

// Pointers to the elements in the canonical order.
template <class Element, class Less>
std::vector<const Element*> sorted(const std::vector<Element>& elements, const Less& less) {
  std::vector<const Element*> order(elements.size());
  std::transform(elements.begin(), elements.end(), order.begin(), [](const Element& element) { return &element; });
  std::stable_sort(order.begin(), order.end(), [&](const Element* a, const Element* b) { return less(*a, *b); });
  return order;
}

template <class Element>
std::vector<const Element*> sorted_by_id(const std::vector<Element>& elements, const char* contract) {
  const auto order = sorted(elements, [](const Element& a, const Element& b) { return a.id < b.id; });
  MAPWEAVE_EXPECT(
      std::adjacent_find(order.begin(), order.end(), [](auto* a, auto* b) { return a->id == b->id; }) == order.end(),
      contract);
  return order;
}

struct Ordered {
  explicit Ordered(const StoredMaps& stored)
      : maps(sorted_by_id(stored.maps, "every map has its own id")),
        judgements(sorted_by_id(stored.judgements, "every judgement has its own id")),
        verdicts(sorted(stored.verdicts, [](const Verdict& a, const Verdict& b) {
          return std::tie(a.a, a.b, a.by) < std::tie(b.a, b.b, b.by);
        })) {
    for (const Map* map : maps)
      MAPWEAVE_EXPECT(is_valid_name(map->id.str()), "a map has a valid name: '" + map->id.str() + "'");
    for (const MemberMap* member : sorted(stored.members, [](const MemberMap&a, const MemberMap&b) {
           return std::tie(a.team, a.own.id) < std::tie(b.team, b.own.id);
         })) {
      const auto team = std::find_if(maps.begin(), maps.end(), [&](const Map* map) { return map->id == member->team; });
      MAPWEAVE_EXPECT(team != maps.end(), "a member's team map is in the store: '" + member->team.str() + "'");
      members.push_back({team - maps.begin(), encode(member_update(**team, member->own))});
    }
  }
  struct Member {
    std::int64_t team;  // place among the maps
    std::string update;
  };
  std::vector<const Map*> maps;
  std::vector<Member> members;
  std::vector<const Judgement*> judgements;
  std::vector<const Verdict*> verdicts;
};

Hash identity(const Ordered& ordered) {
  Hasher hasher;
  hasher.add("maps").add(static_cast<std::int64_t>(ordered.maps.size()));
  for (const Map* map : ordered.maps) hasher.add(map->id.str()).add(content_hash(*map)).add(encode(belief_of(*map)));
  hasher.add("judgements").add(static_cast<std::int64_t>(ordered.judgements.size()));
  for (const Judgement* judgement : ordered.judgements) hasher.add(encode(*judgement));
  hasher.add("verdicts").add(static_cast<std::int64_t>(ordered.verdicts.size()));
  for (const Verdict* verdict : ordered.verdicts) hasher.add(encode(*verdict));
  if (ordered.members.empty()) return hasher.finish();
  hasher.add("members").add(static_cast<std::int64_t>(ordered.members.size()));
  for (const Ordered::Member& member : ordered.members) hasher.add(member.team).add(member.update);
  return hasher.finish();
}

// A file beside its goal, removed with all that SQLite put beside it unless renamed into place.
class PartialFile {
 public:
  explicit PartialFile(const fs::path& goal) : goal_(goal), path_(goal) {
    static std::atomic<unsigned> count{0};
    path_ += ".partial-" + std::to_string(::getpid()) + "-" + std::to_string(count++);
    remove();
  }
  ~PartialFile() { remove(); }
  PartialFile(const PartialFile&) = delete;
  PartialFile& operator=(const PartialFile&) = delete;
  const fs::path& path() const { return path_; }

  void commit() {
    const int file = ::open(path_.c_str(), O_RDONLY | O_CLOEXEC);
    const bool synced = file >= 0 && ::fsync(file) == 0;
    if (file >= 0) ::close(file);
    if (!synced || ::rename(path_.c_str(), goal_.c_str()) != 0)
      throw Error(ErrorCode::kCannotWrite, "cannot be written: " + std::generic_category().message(errno),
                  goal_.string(),
                  "check that the folder exists, that you may write there and that its disk is not full");
    const fs::path folder = fs::absolute(goal_).parent_path();
    const int parent = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (parent < 0) return;  // some file systems cannot sync folders; that is no reason to fail
    ::fsync(parent);
    ::close(parent);
  }

 private:
  void remove() {
    std::error_code ignored;
    for (const char* suffix : {"", "-wal", "-shm", "-journal"}) fs::remove(path_.string() + suffix, ignored);
  }
  fs::path goal_, path_;
};

void fill(Database& database, const Ordered& ordered, const StoredMaps& stored) {
  StoreIndex index;
  index.summary.schema = ordered.members.empty() ? kSchemaVersion - 1 : kSchemaVersion;
  index.summary.metadata = stored.metadata;
  index.summary.judgements = ordered.judgements.size();
  index.summary.verdicts = ordered.verdicts.size();
  index.summary.identity = identity(ordered);
  create_tables(database, index.summary.schema);
  for (const Map* map : ordered.maps) {
    const auto place = static_cast<std::int64_t>(index.summary.maps.size());
    for (const auto& [id, submap] : map->submaps)
      MAPWEAVE_EXPECT(!submap.frozen || submap.content == content_hash(submap, map->nodes),
                      "a frozen submap holds what its hash says: " + to_string(id));
    for_each_update(
        *map, [&](const MapUpdate& update) { insert_blob(database, index, BlobKind::update, place, encode(update)); });
    index.summary.maps.push_back(summary_of(*map));
  }
  for (std::size_t begin = 0; begin < ordered.judgements.size(); begin += kMostJudgements) {
    MapUpdate update;
    for (std::size_t i = begin; i < std::min(begin + kMostJudgements, ordered.judgements.size()); ++i)
      update.judgements.push_back(*ordered.judgements[i]);
    insert_blob(database, index, BlobKind::judgements, 0, encode(update));
  }
  for (const Verdict* verdict : ordered.verdicts) insert_blob(database, index, BlobKind::verdict, 0, encode(*verdict));
  for (const Ordered::Member& member : ordered.members)
    insert_blob(database, index, BlobKind::member, member.team, member.update);
  write_index(database, index);
}

StoreIndex open_index(Database& database, const fs::path& path) {
  database.run("PRAGMA cell_size_check = ON");
  StoreIndex index = read_index(database, expect_tables(database));
  index.summary.file_bytes = fs::file_size(path);
  return index;
}

}  // namespace

Hash identity(const StoredMaps& stored) { return identity(Ordered(stored)); }

void write_store(const fs::path& path, const StoredMaps& stored) {
  const Ordered ordered(stored);
  std::error_code ignored;
  if (fs::is_directory(path, ignored))
    throw Error(ErrorCode::kCannotWrite, "it is a folder; a map store is a file", path.string(), "choose another name");
  PartialFile partial(path);
  Database database(partial.path(), Database::Use::create, path);
  // The file is nobody's until it is renamed: no other process looks at it, and PartialFile syncs it. Each blob is a
  // transaction of its own, so that the log beside it stays small.
  database.run(
      "PRAGMA page_size = 4096; PRAGMA locking_mode = EXCLUSIVE; PRAGMA journal_mode = WAL; PRAGMA synchronous = OFF");
  fill(database, ordered, stored);
  database.run("PRAGMA wal_checkpoint(TRUNCATE); PRAGMA journal_mode = DELETE");
  database.close();
  partial.commit();
}

StoredMaps read_store(const fs::path& path) {
  expect_sqlite_file(path, "map store", ".mwdb");
  Database database(path, Database::Use::read, path);
  const StoreIndex index = open_index(database, path);
  const std::string where = path.string();
  StoredMaps stored;
  stored.metadata = index.summary.metadata;
  for (const StoredMapSummary& summary : index.summary.maps) {
    stored.maps.emplace_back();
    stored.maps.back().id = summary.id;
  }
  try {
    for (const BlobEntry& entry : index.updates) {
      Map& map = stored.maps[static_cast<std::size_t>(entry.owner)];
      map = updated(std::move(map), decode_map_update(read_blob(database, BlobKind::update, entry),
                                                      where + ", map '" + map.id.str() + "'"));
    }
    for (const BlobEntry& entry : index.members) {
      const Map& team = stored.maps[static_cast<std::size_t>(entry.owner)];
      const MapUpdate update = decode_map_update(read_blob(database, BlobKind::member, entry),
                                                 where + ", members of '" + team.id.str() + "'");
      stored.members.push_back({team.id, member_of(team, update)});
    }
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kBadInput) throw;
    database.corrupt(error.problem());
  }
  for (const BlobEntry& entry : index.judgements) {
    MapUpdate update = decode_map_update(read_blob(database, BlobKind::judgements, entry), where + ", judgements");
    if (!stored.judgements.empty() && !update.judgements.empty() &&
        !(stored.judgements.back().id < update.judgements.front().id))
      database.corrupt("its judgements are not in order");
    std::move(update.judgements.begin(), update.judgements.end(), std::back_inserter(stored.judgements));
  }
  for (const BlobEntry& entry : index.verdicts)
    stored.verdicts.push_back(decode_verdict(read_blob(database, BlobKind::verdict, entry), where + ", verdicts"));
  const bool counts =
      stored.judgements.size() == index.summary.judgements && stored.verdicts.size() == index.summary.verdicts;
  if (!counts || identity(stored) != index.summary.identity) database.corrupt("it does not hold what it says");
  return stored;
}

StoreSummary summarize_store(const fs::path& path) {
  expect_sqlite_file(path, "map store", ".mwdb");
  Database database(path, Database::Use::read, path);
  return open_index(database, path).summary;
}

}  // namespace mapweave::mapdb
