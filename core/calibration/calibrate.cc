#include "core/calibration/calibrate.h"

#include <optional>
#include <utility>

#include "core/calibration/calibration_run.h"
#include "core/calibration/noise_factor.h"
#include "core/calibration/partition.h"

namespace selfcal {
namespace {

std::string CheckInput(const Rig& rig,
                       const Calibration& theta_start,
                       const std::optional<ThetaPrior>& prior,
                       const std::vector<const MotionSegment*>& sorted) {
  if (sorted.empty()) {
    return "no segments to calibrate on";
  }
  if (!SameShape(rig.factory, theta_start)) {
    return "the calibration to start from has other cameras than the rig";
  }
  if (prior && (!SameShape(rig.factory, prior->centre) ||
                prior->information.rows() != TangentSize(rig.factory) ||
                prior->information.cols() != TangentSize(rig.factory) ||
                !prior->information.allFinite())) {
    return "the prior on theta does not have the shape of the rig";
  }
  for (std::size_t i = 1; i < sorted.size(); ++i) {
    if (sorted[i - 1]->key == sorted[i]->key) {
      return "segment " + sorted[i]->key.session + "/" +
             std::to_string(sorted[i]->key.index) + " is given twice";
    }
  }
  return "";
}

}  // namespace

CalibrationResult Calibrate(const Rig& rig,
                            const Calibration& theta_start,
                            const std::vector<MotionSegment>& segments,
                            const CalibrateOptions& options,
                            const ProgressCallback& progress) {
  const std::vector<const MotionSegment*> sorted = SortByKey(segments);
  const std::string problem =
      CheckInput(rig, theta_start, options.prior, sorted);
  if (!problem.empty()) {
    CalibrationResult result;
    result.message = problem;
    result.theta = theta_start;
    return result;
  }
  return RunCalibration(rig, theta_start, sorted, options, progress);
}

}  // namespace selfcal
