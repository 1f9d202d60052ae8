// Which observations of a segment a score stands on, and where its landmarks
// are linearised. Pure, deterministic, any thread.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/information/segment_information.h"
#include "core/model/calibration.h"
#include "core/model/segment.h"

namespace selfcal {

struct InlierSelection {
  // In G [m], one for each landmark of the segment: refined where that lowers
  // the robust reprojection error, else as the SLAM system gave it.
  std::vector<Eigen::Vector3d> landmarks;
  // Indices into segment.observations, sorted by (landmark, keyframe, camera).
  std::vector<int> inliers;
  // All but inertial_rms.
  ResidualStatistics statistics;
};

// Moves each landmark by up to two Gauss-Newton steps with the keyframes held,
// so that the noise of a landmark does not hide which of its observations is
// wrong; then leaves out what does not project, what lies further than
// options.outlier_gate robust standard deviations (from the median residual of
// the segment, at least pixel_sigma_px) from its prediction, and landmarks with
// fewer than two observations left.
InlierSelection SelectInliers(const Calibration& theta0,
                              double pixel_sigma_px,
                              const MotionSegment& segment,
                              const ScoreOptions& options);

}  // namespace selfcal
