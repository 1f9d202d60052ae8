#include "core/preflight/late_states.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/preflight/time_offset.h"
#include "core/preflight/views.h"

namespace selfcal {
namespace {

constexpr double kSigmas = 6;

bool HasDelays(const Calibration& theta) {
  return std::ranges::any_of(theta.cameras,
                             [](const CameraCalibration& camera) {
                               return camera.time_offset_s != 0 ||
                                      camera.time_drift || camera.line_delay_s;
                             });
}

// From the stamps to the middle of the images, on average over the cameras.
double MeanDelay(const Calibration& theta, const MotionSegment& segment) {
  const double session_s = SessionTime(segment, segment.keyframes.front());
  double sum_s = 0;
  for (const CameraCalibration& camera : theta.cameras) {
    sum_s += MiddleRowDelay(camera, session_s);
  }
  return sum_s / static_cast<double>(theta.cameras.size());
}

// The time by which states are late, if they are.
double PossibleDelay(const Calibration& theta, const MotionSegment& segment) {
  const auto found = EstimateTimeOffset(theta, std::span(&segment, 1));
  if (!found) return MeanDelay(theta, segment);
  const double least_s = std::max(kLeastTimeOffset_s, kSigmas * found->sigma_s);
  return std::abs(found->offset_s) > least_s ? found->offset_s : 0;
}

double MedianError(const Rig& rig,
                   const Calibration& theta,
                   const MotionSegment& segment,
                   double late_s) {
  std::vector<double> errors_px;
  for (std::size_t j = 0; j < theta.cameras.size(); ++j) {
    for (const View& view : CollectViews(rig,
                                         theta,
                                         std::span(&segment, 1),
                                         std::span(&late_s, 1),
                                         static_cast<int>(j))) {
      errors_px.push_back(ErrorOf(view, theta.cameras[j], view.p));
    }
  }
  return Summarise(std::move(errors_px)).median_px;
}

double FindLateStates(const Rig& rig,
                      const Calibration& theta,
                      const MotionSegment& segment) {
  if (segment.keyframes.empty()) return 0;
  const double late_s = PossibleDelay(theta, segment);
  if (late_s == 0) return 0;
  const bool better = MedianError(rig, theta, segment, late_s) <
                      MedianError(rig, theta, segment, 0);
  return better ? late_s : 0;
}

}  // namespace

std::vector<double> FindLateStates(const Rig& rig,
                                   const Calibration& theta,
                                   std::span<const MotionSegment> segments) {
  std::vector<double> late_s(segments.size(), 0);
  if (!HasDelays(theta)) return late_s;
  for (std::size_t s = 0; s < segments.size(); ++s) {
    late_s[s] = FindLateStates(rig, theta, segments[s]);
  }
  return late_s;
}

}  // namespace selfcal
