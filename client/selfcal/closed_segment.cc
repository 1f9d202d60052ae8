#include "client/selfcal/closed_segment.h"

#include <algorithm>
#include <unordered_map>
#include <unordered_set>
#include <utility>

#include "client/selfcal/track_positions.h"
#include "core/calibration/problem.h"
#include "core/factor/state_time.h"
#include "core/model/temperature.h"

namespace selfcal::client {
namespace {

struct Sighting {
  std::int32_t camera;
  std::uint64_t landmark_id;
  friend bool operator==(const Sighting&, const Sighting&) = default;
};

struct SightingHash {
  std::size_t operator()(const Sighting& sighting) const {
    return std::hash<std::uint64_t>{}(
        sighting.landmark_id * 31 +
        static_cast<std::uint64_t>(sighting.camera));
  }
};

// Returns, for each keyframe, the first observation of each landmark by each
// camera.
std::vector<std::vector<const KeyframeObservation*>> WithoutDuplicates(
    const std::vector<ObservedKeyframe>& keyframes) {
  std::vector<std::vector<const KeyframeObservation*>> all;
  all.reserve(keyframes.size());
  std::unordered_set<Sighting, SightingHash> seen;
  for (const ObservedKeyframe& keyframe : keyframes) {
    seen.clear();
    auto& unique = all.emplace_back();
    unique.reserve(keyframe.observations.size());
    for (const KeyframeObservation& observation : keyframe.observations) {
      if (seen.insert({observation.camera, observation.landmark_id}).second) {
        unique.push_back(&observation);
      }
    }
  }
  return all;
}

// What the segment knows of one landmark.
struct LandmarkRecord {
  int observations = 0;
  std::optional<Eigen::Vector3d> p_G;  // the last one
  std::int32_t index = -1;             // in the segment
};

bool IsPosition(const Eigen::Vector3d& p_G) {
  constexpr SegmentLimits kLimits;
  // The comparison is false for NaN.
  return p_G.cwiseAbs().maxCoeff() <= kLimits.max_position_m;
}

using KeyframeSightings = std::vector<std::vector<const KeyframeObservation*>>;

// The landmarks of a segment, by the id of the SLAM system.
class Landmarks {
 public:
  Landmarks(const KeyframeSightings& keyframes, int min_observations)
      : keyframes_(keyframes) {
    for (const auto& observations : keyframes) {
      for (const KeyframeObservation* seen : observations) {
        LandmarkRecord& record = records_[seen->landmark_id];
        ++record.observations;
        if (IsPosition(seen->p_G)) record.p_G = seen->p_G;
      }
    }
    std::erase_if(records_, [&](const auto& entry) {
      return entry.second.observations < min_observations;
    });
  }

  // Triangulates the landmarks without a position, and removes those that have
  // none then. `segment` has its keyframes and samples.
  void CompletePositions(const ClosedSegment& closed,
                         const MotionSegment& segment,
                         AssemblyStatistics* statistics) {
    const auto lacks_position = [](const auto& entry) {
      return !entry.second.p_G.has_value();
    };
    const auto count = static_cast<std::uint64_t>(
        std::count_if(records_.begin(), records_.end(), lacks_position));
    if (count == 0) return;
    if (closed.theta != nullptr) Triangulate(closed, segment);
    const std::uint64_t dropped = std::erase_if(records_, lacks_position);
    statistics->tracks_dropped += dropped;
    statistics->tracks_triangulated += count - dropped;
  }

  // Adds the landmarks, in the order of their first observation, and their
  // observations.
  void AddTo(MotionSegment* segment) {
    for (std::size_t k = 0; k < keyframes_.size(); ++k) {
      for (const KeyframeObservation* seen : keyframes_[k]) {
        const auto found = records_.find(seen->landmark_id);
        if (found == records_.end()) continue;
        LandmarkRecord& record = found->second;
        if (record.index < 0) {
          record.index = static_cast<std::int32_t>(segment->landmarks.size());
          segment->landmarks.push_back({seen->landmark_id, *record.p_G});
        }
        segment->observations.push_back({static_cast<std::int32_t>(k),
                                         seen->camera,
                                         record.index,
                                         seen->z_px});
      }
    }
  }

 private:
  void Triangulate(const ClosedSegment& closed, const MotionSegment& segment) {
    const std::vector<Track> tracks =
        TracksWithoutPosition(closed.theta->cameras.size());
    const auto positions = TriangulateTracks(*closed.theta,
                                             segment,
                                             tracks,
                                             closed.pixel_sigma_px,
                                             closed.gravity_mps2);
    for (std::size_t t = 0; t < tracks.size(); ++t) {
      if (positions[t] && IsPosition(*positions[t])) {
        records_[tracks[t].id].p_G = positions[t];
      }
    }
  }

  std::vector<Track> TracksWithoutPosition(std::size_t cameras) const {
    std::vector<Track> tracks;
    std::unordered_map<std::uint64_t, std::size_t> index;
    for (std::size_t k = 0; k < keyframes_.size(); ++k) {
      for (const KeyframeObservation* seen : keyframes_[k]) {
        const auto found = records_.find(seen->landmark_id);
        if (found == records_.end() || found->second.p_G) continue;
        // The daemon refuses such a camera; here it must not be used.
        const auto camera = static_cast<std::size_t>(seen->camera);
        if (seen->camera < 0 || camera >= cameras) continue;
        const auto [entry, is_new] =
            index.emplace(seen->landmark_id, tracks.size());
        if (is_new) tracks.push_back({seen->landmark_id});
        tracks[entry->second].observations.push_back(
            {static_cast<int>(k), seen->camera, seen->z_px});
      }
    }
    for (Track& track : tracks) {
      std::stable_sort(track.observations.begin(),
                       track.observations.end(),
                       [](const auto& a, const auto& b) {
                         return a.keyframe != b.keyframe
                                    ? a.keyframe < b.keyframe
                                    : a.camera < b.camera;
                       });
    }
    return tracks;
  }

  const KeyframeSightings& keyframes_;
  std::unordered_map<std::uint64_t, LandmarkRecord> records_;
};

// The states at the timestamps of their images.
std::vector<KeyframeState> StatesAtImages(const ClosedSegment& closed) {
  ImuCalibration imu;
  if (closed.theta != nullptr) {
    const double reference_c = closed.theta->reference_temperature_c;
    imu =
        AtTemperature(*closed.theta, closed.temperature_c.value_or(reference_c))
            .imu;
  }
  std::vector<KeyframeState> states;
  states.reserve(closed.keyframes.size());
  for (const ObservedKeyframe& keyframe : closed.keyframes) {
    KeyframeState state = keyframe.state;
    if (keyframe.state_offset_ns != 0) {
      state.t_ns += keyframe.state_offset_ns;
      state = MoveState(
          state, keyframe.state.t_ns, closed.imu, imu, closed.gravity_mps2);
    }
    states.push_back(state);
  }
  return states;
}

// Returns the samples from the last at or before `begin_ns` to the first at or
// after `end_ns`.
std::vector<ImuSample> ImuBetween(const std::vector<ImuSample>& imu,
                                  std::int64_t begin_ns,
                                  std::int64_t end_ns) {
  const auto before = [](const ImuSample& sample, std::int64_t t_ns) {
    return sample.t_ns < t_ns;
  };
  auto first = std::lower_bound(imu.begin(), imu.end(), begin_ns, before);
  if (first != imu.begin() && (first == imu.end() || first->t_ns > begin_ns)) {
    --first;
  }
  auto last = std::lower_bound(first, imu.end(), end_ns, before);
  if (last != imu.end()) ++last;
  return {first, last};
}

}  // namespace

MotionSegment Assemble(const ClosedSegment& closed,
                       AssemblyStatistics* statistics) {
  AssemblyStatistics unused;
  MotionSegment segment;
  segment.key = closed.key;
  segment.calibration_version = closed.calibration_version;
  segment.temperature_c = closed.temperature_c;
  segment.session_start_ns = closed.session_start_ns;
  segment.keyframes = StatesAtImages(closed);
  segment.imu = ImuBetween(closed.imu, closed.begin_ns, closed.end_ns);
  segment.imu1 = ImuBetween(closed.imu1, closed.begin_ns, closed.end_ns);
  const KeyframeSightings sightings = WithoutDuplicates(closed.keyframes);
  Landmarks landmarks(sightings, closed.min_observations);
  landmarks.CompletePositions(
      closed, segment, statistics == nullptr ? &unused : statistics);
  landmarks.AddTo(&segment);
  return segment;
}

}  // namespace selfcal::client
