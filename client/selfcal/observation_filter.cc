#include "client/selfcal/observation_filter.h"

#include "core/model/image_bounds.h"

namespace selfcal::client {
namespace {

// The ids of an epoch are shifted by a multiple of 2^64 divided by the golden
// ratio: the multiples are spread so evenly that small ids, as counters assign
// them, do not meet those of another epoch (2^49 apart for 10,000 epochs).
constexpr std::uint64_t kEpochShift = 0x9E3779B97F4A7C15;

bool IsUsable(const KeyframeObservation& observation,
              const Calibration* theta) {
  if (!observation.z_px.allFinite()) return false;
  const auto camera = static_cast<std::size_t>(observation.camera);
  if (theta == nullptr || observation.camera < 0 ||
      camera >= theta->cameras.size()) {
    return true;
  }
  constexpr SegmentLimits kLimits;
  return IsInImage(
      theta->cameras[camera], observation.z_px, kLimits.pixel_margin_px);
}

}  // namespace

std::vector<KeyframeObservation> ObservationFilter::Filter(
    std::span<const KeyframeObservation> observations,
    const Calibration* theta) {
  std::vector<KeyframeObservation> kept;
  kept.reserve(observations.size());
  for (const KeyframeObservation& observation : observations) {
    if (!IsUsable(observation, theta)) continue;
    kept.push_back(observation);
    kept.back().landmark_id += id_epoch_ * kEpochShift;
  }
  dropped_ += observations.size() - kept.size();
  return kept;
}

}  // namespace selfcal::client
