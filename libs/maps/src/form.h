#pragma once
// Our values to and from the messages of proto/mapweave.proto, one at a time. The framing of a whole update is
// codec.cpp's.

#include <mapweave.pb.h>
#include <mapweave/core/error.h>
#include <mapweave/maps/exchange.h>

#include <map>

namespace mapweave {

// The sessions that a message names, ascending; ids hold a place in it.
class SessionTable {
 public:
  void add(const SessionId& session) {  // while collecting
    if (sessions_.empty() || sessions_.back() != session) sessions_.push_back(session);
  }
  void sort();
  std::uint32_t place(const SessionId&) const;
  const std::vector<SessionId>& sessions() const { return sessions_; }

 private:
  std::vector<SessionId> sessions_;
};

form::Session form_of(const SessionId&);
form::ScanGeometry form_of(const ScanGeometry&);
void fill_measured(form::Scan&, const PackedScan&);  // all but the place of its geometry
form::CameraGeometry form_of(const CameraGeometry&);

// The geometries that the scans, or the keyframes, of a message share, in order of first use; alike ones (bit for bit)
// are one.
template <class Geometry>
class GeometryTable {
 public:
  void add(const std::shared_ptr<const Geometry>& geometry) {
    if (places_.count(geometry.get()) > 0) return;
    const auto [entry, is_new] =
        place_by_bytes_.emplace(form_of(*geometry).SerializeAsString(), static_cast<std::uint32_t>(geometries_.size()));
    if (is_new) geometries_.push_back(geometry);
    places_.emplace(geometry.get(), entry->second);
  }
  std::uint32_t place(const std::shared_ptr<const Geometry>& geometry) const { return places_.at(geometry.get()); }
  const std::vector<std::shared_ptr<const Geometry>>& geometries() const { return geometries_; }

 private:
  std::vector<std::shared_ptr<const Geometry>> geometries_;
  std::map<const Geometry*, std::uint32_t> places_;  // never walked: the order of pointers stays inside
  std::map<std::string, std::uint32_t> place_by_bytes_;
};

struct Geometries {
  GeometryTable<ScanGeometry> lasers;
  GeometryTable<CameraGeometry> cameras;
};

form::Id form_of(const NodeId&, const SessionTable&);
form::Id form_of(const SubmapId&, const SessionTable&);
form::Id form_of(const LandmarkId&, const SessionTable&);
form::Node form_of(const Node&, const SessionTable&, const Geometries&);
form::MovedNode form_of(const MovedNode&, const SessionTable&);
form::Submap form_of(const Submap&, const SessionTable&);
form::ConstraintId form_of(const ConstraintId&, const SessionTable&);
form::Constraint form_of(const Constraint&, const SessionTable&);
form::Judgement form_of(const Judgement&, const SessionTable&);
form::Verdict form_of(const Verdict&);
form::Landmark form_of(const Landmark&, const SessionTable&);
form::LandmarkChange form_of(const LandmarkChange&, const SessionTable&);
form::SharedLandmark form_of(const DescribedLandmark&, const SessionTable&);
form::Pose form_of(const Pose3&);
form::Keyframe form_of(const KeyframeFeatures&, const Geometries&);

// Writes floats in place of what they hold exactly (form 7); everything else has none.
void shorten(form::Node&);
void shorten(form::MovedNode&);
void shorten(form::Submap&);
void shorten(form::Constraint&);
template <class Form>
void shorten(Form&) {}

// Reads what was parsed from bytes that nobody vouches for. Everything it returns is sound (soundness.h).
class FormReader {
 public:
  explicit FormReader(const std::string& where) : where_(where) {}

  void take_session(const form::Session&);  // in the order of the table
  void take_geometry(const form::ScanGeometry&);
  void take_camera(const form::CameraGeometry&);
  void locate(std::string place) { place_ = std::move(place); }  // what follows stands there, for messages
  [[noreturn]] void corrupt(const std::string& what) const;

  NodeId node_id(const form::Id&) const;
  SubmapId submap_id(const form::Id&) const;
  LandmarkId landmark_id(const form::Id&) const;
  ConstraintId constraint_id(const form::ConstraintId&) const;
  Node node(const form::Node&) const;
  MovedNode moved(const form::MovedNode&) const;
  Submap submap(const form::Submap&) const;
  Constraint constraint(const form::Constraint&) const;
  Judgement judgement(const form::Judgement&) const;
  Verdict verdict(const form::Verdict&) const;
  Landmark landmark(const form::Landmark&) const;
  LandmarkChange landmark_change(const form::LandmarkChange&) const;
  DescribedLandmark shared_landmark(const form::SharedLandmark&) const;
  Pose3 pose(const form::Pose&) const;
  Hash hash(const std::string& bytes) const;
  SessionId session(std::uint32_t place) const;
  KeyframeFeatures keyframe(const form::Keyframe&) const;
  PackedScan scan(const form::Scan&) const;
  std::string name_or_nothing(const std::string& text, const char* of_what) const;

 private:
  template <class Value>
  void require_sound(const Value& value) const;
  Sim3 similarity(const form::Similarity&) const;
  Eigen::Matrix<double, 6, 6> matrix(const form::Matrix6&) const;
  template <class Numbers>
  Eigen::Matrix<double, 6, 6> matrix_of(const Numbers&) const;
  Alignment alignment(const form::Alignment&) const;
  std::shared_ptr<const Payload> payload(const form::Node&) const;
  OccupancyGrid grid(const form::Grid&) const;
  template <class Form>
  std::vector<LandmarkSighting> sightings(const Form&, const SessionId& own) const;
  template <class Form>
  Eigen::Vector3i point(const Form&) const;

  const std::string& where_;
  std::string place_;
  std::vector<SessionId> sessions_;
  std::vector<std::shared_ptr<const ScanGeometry>> geometries_;
  std::vector<std::shared_ptr<const CameraGeometry>> cameras_;
};

}  // namespace mapweave
