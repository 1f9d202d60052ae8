// Compares two calibrations of one rig: their difference, and whether it
// exceeds their uncertainty.
//
// Two estimates from separate segments have independent errors: the covariance
// of their difference is Sigma_a + Sigma_b. Segments that both are based on
// move both in the same way. With the information Lambda_s of these, and P and
// Q that of the others,
//   Sigma_a^-1 = Lambda_s + P,   Sigma_b^-1 = Lambda_s + Q,
//   Cov(b - a) = (Sigma_a - Sigma_b) Lambda_s (Sigma_a - Sigma_b)
//                + Sigma_a P Sigma_a + Sigma_b Q Sigma_b,
// which is Sigma_a - Sigma_b if b has all segments of a and more. Lambda_s is
// the sum of the information of the individual shared segments, with the
// estimated noise of tracks: their additional joint information, and what both
// versions took from a third one, is not included, so that the covariance is
// too large rather than too small.
//
// Pure, deterministic, callable from any thread.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/change/consistency.h"
#include "core/information/segment_information.h"
#include "core/model/rig.h"

namespace selfcal {

struct CalibrationDifference {
  Eigen::VectorXd difference;  // D: b [-] a
  Eigen::VectorXd
      sigmas;  // of the difference (D); 0 for components that are fixed
  // Test of the whole difference, over the directions for which at least one of
  // the two has clearly more information than the prior. A solver stops within
  // 0.05 sigma of its solution, which is included in the uncertainty.
  ConsistencyTest test;
};

// `shared`: the information of the segments that both are based on; entries
// that do not have the shape of the rig are ignored.
CalibrationDifference CompareCalibrations(
    const Rig& rig,
    const KnownCalibration& a,
    const KnownCalibration& b,
    const std::vector<SegmentInformation>& shared);

}  // namespace selfcal
