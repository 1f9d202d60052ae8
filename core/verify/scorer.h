// Two implementations of the score of a segment that share no code for
// residuals, Jacobians and elimination, so that each verifies the other.
//
// kStructured is ScoreSegment() of core/information: vectorised kernels, and an
// elimination along the chain of keyframes. kCeres evaluates the factors of
// core/factor/ceres_factors.h in a ceres::Problem, and factorises its Jacobian
// with theta last by CHOLMOD, which takes far longer. Both use the same inliers
// and landmarks (InlierSelector), weak priors and gauge, and score the groups
// by the same code.
//
// Pure, callable from any thread, deterministic.
#pragma once

#include "core/information/segment_information.h"
#include "core/model/calibration.h"
#include "core/model/rig.h"
#include "core/model/segment.h"

namespace selfcal {

enum class ScorerKind { kStructured, kCeres };

// Returns true if this program was built with Ceres (SELFCAL_CERES). Without it
// ScorerKind::kCeres and SolverKind::kCeres cannot be used.
bool HasCeres();

// Same as ScoreSegment(). Throws std::runtime_error, with a remedy in its
// message, if the score cannot be computed: without Ceres, or if CHOLMOD finds
// the normal equations not positive definite, as they are up to rounding for a
// segment without observations.
SegmentInformation ScoreSegmentBy(ScorerKind scorer,
                                  const Rig& rig,
                                  const Calibration& theta0,
                                  const MotionSegment& segment,
                                  const ScoreOptions& options = {});

}  // namespace selfcal
