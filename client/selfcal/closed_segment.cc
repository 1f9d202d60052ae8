#include "client/selfcal/closed_segment.h"

#include <algorithm>
#include <span>
#include <unordered_map>
#include <unordered_set>
#include <utility>

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

// Adds the landmarks that are seen often enough, in the order of their first
// observation, and their observations.
void AddLandmarks(const ClosedSegment& closed, MotionSegment* segment) {
  const auto keyframes = WithoutDuplicates(closed.keyframes);
  std::unordered_map<std::uint64_t, int> count;
  for (const auto& observations : keyframes) {
    for (const KeyframeObservation* seen : observations) {
      ++count[seen->landmark_id];
    }
  }
  std::unordered_map<std::uint64_t, std::int32_t> index;
  for (std::size_t k = 0; k < keyframes.size(); ++k) {
    for (const KeyframeObservation* seen : keyframes[k]) {
      if (count[seen->landmark_id] < closed.min_observations) continue;
      const auto next = static_cast<std::int32_t>(segment->landmarks.size());
      const auto [entry, is_new] = index.emplace(seen->landmark_id, next);
      if (is_new) segment->landmarks.push_back({seen->landmark_id, seen->p_G});
      segment->landmarks[static_cast<std::size_t>(entry->second)].p_G =
          seen->p_G;
      segment->observations.push_back({static_cast<std::int32_t>(k),
                                       seen->camera,
                                       entry->second,
                                       seen->z_px});
    }
  }
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

MotionSegment Assemble(const ClosedSegment& closed) {
  MotionSegment segment;
  segment.key = closed.key;
  segment.calibration_version = closed.calibration_version;
  segment.temperature_c = closed.temperature_c;
  segment.keyframes.reserve(closed.keyframes.size());
  for (const ObservedKeyframe& keyframe : closed.keyframes) {
    segment.keyframes.push_back(keyframe.state);
  }
  if (!closed.keyframes.empty()) {
    segment.imu = ImuBetween(
        closed.imu, closed.keyframes.front().state.t_ns, closed.end_ns);
  }
  AddLandmarks(closed, &segment);
  return segment;
}

}  // namespace selfcal::client
