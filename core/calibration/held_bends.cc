#include "core/calibration/held_bends.h"

#include <Eigen/Cholesky>
#include <cmath>
#include <optional>
#include <vector>

#include "core/calibration/structured_solver.h"
#include "core/model/symmetric_eigen.h"

namespace selfcal {
namespace {

constexpr int kMaxBendIterations = 10;
// A minimum is accurate enough when an iteration reduces the cost by less [half
// squares].
constexpr double kEnoughBend = 0.01;

// Moves the estimated directions along with the held ones.
class Bends {
 public:
  explicit Bends(const WorkingPoint& point)
      : point_(point),
        basis_(TangentBasis(point.rig(), point.subspace())),
        round_(point.Round(basis_)) {}

  // The square root of a covariance. Steps of one sigma of the prior, and the
  // information of the data along each.
  Eigen::MatrixXd Along(const Eigen::MatrixXd& steps,
                        const Eigen::VectorXd& information) {
    Eigen::MatrixXd bends(steps.rows(), 0);
    if (!LineariseRound(round_,
                        point_.estimate(),
                        point_.screening().landmarks,
                        &round_.loss,
                        &linearised_)) {
      return bends;
    }
    const auto here = MinimumAt(Eigen::VectorXd::Zero(steps.rows()));
    if (!here) return bends;
    for (int j = 0; j < steps.cols(); ++j) {
      auto bend = AlongOne(*here, steps.col(j), information(j));
      if (!bend || !bend->allFinite()) continue;
      // The prior holds for the others as well: a parabola that leads beyond it
      // describes nothing.
      const double priors =
          bend->cwiseQuotient(PriorSigmas(point_.rig())).norm();
      if (priors > 1) *bend /= priors;
      bends.conservativeResize(Eigen::NoChange, bends.cols() + 1);
      bends.rightCols<1>() = *bend;
    }
    return bends;
  }

 private:
  std::optional<Eigen::VectorXd> AlongOne(const Eigen::VectorXd& here,
                                          const Eigen::VectorXd& step,
                                          double information) const {
    // The data and the prior say this about h.
    const double variance = 1 / (1 + information);
    const double mean = variance * linearised_.by_offset.eta.dot(step);
    const double sigma = std::sqrt(variance);
    const auto before = MinimumAt(-sigma * step);
    const auto after = MinimumAt(sigma * step);
    if (!before || !after) return std::nullopt;
    const Eigen::VectorXd q = ((*before + *after) / 2 - here) / variance;
    const double square = mean * mean;
    return q * std::sqrt(square * square + 6 * square * variance +
                         3 * variance * variance);
  }

  // d at the minimum over the estimated directions, from the estimate moved by
  // a step.
  std::optional<Eigen::VectorXd> MinimumAt(
      const Eigen::VectorXd& step_d) const {
    CalibrationEstimate estimate = point_.estimate();
    std::vector<ScreenedLandmark> landmarks = point_.screening().landmarks;
    ApplyStep(linearised_, step_d, &estimate, &landmarks);
    SolverRound round = round_;
    round.max_iterations = kMaxBendIterations;
    const SolverOutcome outcome = SolveRoundByStructure(
        round, EndBelow(kEnoughBend), &estimate, &landmarks);
    if (outcome.status != SolverStatus::kConverged) return std::nullopt;
    return estimate.d;
  }

  const WorkingPoint& point_;
  const Eigen::MatrixXd basis_;
  const SolverRound round_;
  LinearisedRound linearised_;
};

}  // namespace

Eigen::MatrixXd BendsOfHeld(const WorkingPoint& point) {
  const ThetaSubspace& subspace = point.subspace();
  const Eigen::MatrixXd none(point.estimate().d.size(), 0);
  if (subspace.held.cols() == 0 || subspace.estimated.cols() == 0) return none;
  const Eigen::MatrixXd& Lambda = point.information().Lambda;
  const Eigen::MatrixXd steps = HeldSteps(point.rig(), subspace, Lambda);
  const SymmetricEigen eigen(steps.transpose() * Lambda * steps);
  const auto observed =
      (eigen.eigenvalues().array() >= kLeastInformation).count();
  if (observed == 0) return none;
  return Bends(point).Along(steps * eigen.eigenvectors().rightCols(observed),
                            eigen.eigenvalues().tail(observed));
}

}  // namespace selfcal
