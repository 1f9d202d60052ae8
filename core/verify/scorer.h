// Two ways to the score of a segment that share no code for residuals,
// Jacobians and elimination, so that each checks the other.
//
// kStructured is ScoreSegment() of core/information: kernels over vectors, and
// an elimination along the chain of keyframes. kCeres evaluates the factors of
// core/factor/ceres_factors.h in a ceres::Problem, and factorises its Jacobian
// with theta last by CHOLMOD, which takes far longer. Both stand on the same
// inliers and landmarks (InlierSelector), weak priors and gauge, and score the
// groups by the same code.
//
// Pure, any thread, deterministic.
#pragma once

#include "core/information/segment_information.h"
#include "core/model/calibration.h"
#include "core/model/rig.h"
#include "core/model/segment.h"

namespace selfcal {

enum class ScorerKind { kStructured, kCeres };

// Whether this program was built with Ceres (SELFCAL_CERES). Without it
// ScorerKind::kCeres and SolverKind::kCeres cannot be used.
bool HasCeres();

// As ScoreSegment(). Throws std::runtime_error, with what to do about it, where
// it cannot be computed: without Ceres, or where CHOLMOD finds the normal
// equations not positive definite, which a segment without observations has to
// rounding.
SegmentInformation ScoreSegmentBy(ScorerKind scorer,
                                  const Rig& rig,
                                  const Calibration& theta0,
                                  const MotionSegment& segment,
                                  const ScoreOptions& options = {});

}  // namespace selfcal
