#include "core/preflight/time_offset.h"

#include <algorithm>
#include <cmath>

#include "core/preflight/motion_data.h"
#include "core/preflight/turns.h"

namespace selfcal {
namespace {

constexpr double kMaxSigma_s = 1e-3;
// Gauss-Newton steps that lead further from the coarse offset have left the
// minimum that it is in.
constexpr double kMaxRefinement_s = 2 * kCoarseStep_s;

}  // namespace

bool IsStatedOffset(const Calibration& theta,
                    double session_s,
                    double offset_s,
                    double tolerance_s) {
  if (std::abs(offset_s) < tolerance_s) return true;
  return std::any_of(theta.cameras.begin(),
                     theta.cameras.end(),
                     [&](const CameraCalibration& camera) {
                       const double first_s = TimeOffsetAt(camera, session_s);
                       const double middle_s =
                           MiddleRowDelay(camera, session_s);
                       return std::abs(offset_s - first_s) < tolerance_s ||
                              std::abs(offset_s - middle_s) < tolerance_s;
                     });
}

std::optional<TimeOffset> EstimateTimeOffset(
    const Calibration& theta, std::span<const MotionSegment> segments) {
  const MotionData data = CollectMotion(segments);
  if (!Turns(data)) return std::nullopt;
  const double coarse_s = AlignRates(data, /*unit=*/1).straight_s;
  RateHypothesis hypothesis{.offset_s = coarse_s};
  const OffsetFit fit = RefineOffset(data, theta.imu, hypothesis);
  // Comparisons are false for NaN.
  if (!(fit.sigma_s <= kMaxSigma_s) ||
      !(std::abs(fit.offset_s - coarse_s) <= kMaxRefinement_s) ||
      !(std::abs(fit.offset_s) <= kMaxTimeOffset_s)) {
    return std::nullopt;
  }
  hypothesis.offset_s = fit.offset_s;
  const RateFit rates = FitRates(data, theta.imu, hypothesis);
  if (rates.intervals < kMinIntervals || rates.share() > kExplained) {
    return std::nullopt;
  }
  return TimeOffset{fit.offset_s, fit.sigma_s};
}

}  // namespace selfcal
