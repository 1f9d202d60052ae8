// Replaces ceres_solver.cc in a build without Ceres (SELFCAL_CERES=OFF).
#include "core/calibration/ceres_solver.h"

namespace selfcal {

SolverOutcome SolveRoundByCeres(const SolverRound&,
                                const SolverCallback&,
                                CalibrationEstimate*,
                                std::vector<ScreenedLandmark>*) {
  SolverOutcome outcome;
  outcome.status = SolverStatus::kFailed;
  outcome.message =
      "this program was built without Ceres; choose the solver \"structured\"";
  return outcome;
}

}  // namespace selfcal
