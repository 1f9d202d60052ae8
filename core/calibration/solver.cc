#include "core/calibration/solver.h"

#include "core/calibration/ceres_solver.h"
#include "core/calibration/structured_solver.h"

namespace selfcal {

SolverOutcome SolveRound(SolverKind kind,
                         const SolverRound& round,
                         const SolverCallback& callback,
                         CalibrationEstimate* estimate,
                         std::vector<ScreenedLandmark>* landmarks) {
  switch (kind) {
    case SolverKind::kStructured:
      return SolveRoundByStructure(round, callback, estimate, landmarks);
    case SolverKind::kCeres:
      break;
  }
  return SolveRoundByCeres(round, callback, estimate, landmarks);
}

}  // namespace selfcal
