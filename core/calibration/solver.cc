#include "core/calibration/solver.h"

#include "core/calibration/ceres_solver.h"
#include "core/calibration/structured_solver.h"

namespace selfcal {

SolverCallback EndBelow(double least) {
  return [least, last = 0.0](
             int iteration, double cost, const Eigen::VectorXd&) mutable {
    const bool enough = iteration > 0 && last - cost < least;
    last = cost;
    return enough ? SolverSignal::kEnough : SolverSignal::kGoOn;
  };
}

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
