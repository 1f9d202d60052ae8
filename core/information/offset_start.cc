#include "core/information/offset_start.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "core/factor/state_time.h"
#include "core/information/inliers.h"
#include "core/model/temperature.h"
#include "core/preflight/time_offset.h"

namespace selfcal {
namespace {

constexpr double kSigmas = 6;

// The states hold `late_s` after their stamps; moves them back.
void MoveToStamps(const Rig& rig,
                  const ImuCalibration& imu,
                  double late_s,
                  MotionSegment* segment) {
  const std::int64_t late_ns = std::llround(late_s * 1e9);
  for (KeyframeState& state : segment->keyframes) {
    const std::int64_t stamp_ns = state.t_ns;
    state.t_ns += late_ns;
    state = MoveState(state, stamp_ns, segment->imu, imu, rig.gravity_mps2);
  }
}

Calibration Later(const Calibration& theta, double by_s) {
  Calibration later = theta;
  for (CameraCalibration& camera : later.cameras) camera.time_offset_s += by_s;
  return later;
}

double MedianResidual(const Rig& rig,
                      const Calibration& theta,
                      const MotionSegment& segment) {
  return SelectInliers(rig, theta, segment, {})
      .statistics.reprojection_median_px;
}

}  // namespace

bool IsEstimatedOfAllCameras(const Rig& rig, const std::string& component) {
  const std::vector<TangentComponent> components =
      TangentComponents(rig.factory);
  const std::vector<int> free = FreeComponents(rig);
  for (std::size_t j = 0; j < rig.factory.cameras.size(); ++j) {
    const std::string name = "cam" + std::to_string(j) + "." + component;
    const bool estimated = std::ranges::any_of(
        free, [&](int i) { return components[i].name == name; });
    if (!estimated) return false;
  }
  return true;
}

std::optional<OffsetStart> FindOffsetStart(const Rig& rig,
                                           const Calibration& theta,
                                           const MotionSegment& segment) {
  if (!IsEstimatedOfAllCameras(rig, "time_offset")) return std::nullopt;
  const SegmentTheta theta_s(theta, segment);
  const auto found = EstimateTimeOffset(*theta_s, std::span(&segment, 1));
  if (!found || std::abs(found->offset_s) <=
                    std::max(kFarTimeOffset_s, kSigmas * found->sigma_s)) {
    return std::nullopt;
  }
  OffsetStart start{theta, 0, segment};
  MoveToStamps(rig, theta_s->imu, found->offset_s, &start.segment);
  Calibration later = Later(theta, found->offset_s);
  if (MedianResidual(rig, later, start.segment) <
      MedianResidual(rig, theta, start.segment)) {
    start.theta = std::move(later);
    start.shift_s = found->offset_s;
  }
  return start;
}

}  // namespace selfcal
