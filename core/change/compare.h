// By what two calibrations of one rig differ, and whether that is more than
// their uncertainty.
//
// Two estimates from segments of their own vary independently: the covariance
// of their difference is Sigma_a + Sigma_b. Segments that both came from move
// both alike. With their information Lambda_s, and P and Q that of the others,
//   Sigma_a^-1 = Lambda_s + P,   Sigma_b^-1 = Lambda_s + Q,
//   Cov(b - a) = (Sigma_a - Sigma_b) Lambda_s (Sigma_a - Sigma_b)
//                + Sigma_a P Sigma_a + Sigma_b Q Sigma_b,
// which is Sigma_a - Sigma_b where b has all segments of a and more. Lambda_s
// is the sum of what the shared segments say one by one, with the noise of
// tracks that was found: what they say only together, and what both versions
// took from a third one, is not in it, so that the covariance comes out too
// large rather than too small.
//
// Pure, deterministic, any thread.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/change/consistency.h"
#include "core/information/segment_information.h"
#include "core/model/rig.h"

namespace selfcal {

struct CalibrationDifference {
  Eigen::VectorXd difference;  // D: b [-] a
  Eigen::VectorXd sigmas;      // D: of it; 0 for components that are fixed
  // Of all of it together, over the directions that at least one of the two
  // knows clearly better than the prior. A solver stops within 0.05 sigma of
  // its solution: so much counts as uncertainty too.
  ConsistencyTest test;
};

// `shared`: what the segments say that both came from; those whose information
// is not of the shape of the rig are not used.
CalibrationDifference CompareCalibrations(
    const Rig& rig,
    const KnownCalibration& a,
    const KnownCalibration& b,
    const std::vector<SegmentInformation>& shared);

}  // namespace selfcal
