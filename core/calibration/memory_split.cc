#include "core/calibration/memory_split.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <vector>

#include "core/change/chi_square.h"
#include "core/change/parameter_blocks.h"

namespace selfcal {
namespace {

constexpr int kFewest = 2;  // segments on either side
// A block may have no part in what is estimated.
constexpr double kNothing = 1e-9;

// Of theta, by the estimated directions.
struct Side {
  Eigen::VectorXd mean;
  Eigen::MatrixXd covariance;
};

// How many of the newest: each half as many again as before.
std::vector<int> SplitsOf(int count) {
  std::vector<int> splits;
  for (int newer = kFewest; newer <= count - kFewest;
       newer += std::max(1, newer / 2)) {
    splits.push_back(newer);
  }
  return splits;
}

// Of a difference with this information, if it is one of the block alone.
double ProbabilityOf(const Eigen::VectorXd& difference,
                     const Eigen::MatrixXd& information,
                     const Eigen::MatrixXd& block) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(
      block.transpose() * information * block);
  const Eigen::VectorXd along = eigen.eigenvectors().transpose() *
                                block.transpose() * information * difference;
  double squares = 0;
  int degrees = 0;
  for (Eigen::Index i = 0; i < along.size(); ++i) {
    if (!(eigen.eigenvalues()(i) > kNothing)) continue;
    ++degrees;
    squares += along(i) * along(i) / eigen.eigenvalues()(i);
  }
  return degrees > 0 ? ChiSquareTail(squares, degrees) : 1;
}

}  // namespace

MemorySplit FindSplit(const Rig& rig,
                      const Calibration& theta,
                      const Eigen::MatrixXd& estimated,
                      double excess,
                      std::span<const JoinedSegment> segments,
                      const EvictedOptions& options) {
  const std::vector<int> free = FreeComponents(rig);
  const Eigen::VectorXd scale = PriorSigmas(rig)(free);
  const Eigen::MatrixXd directions = estimated(free, Eigen::all);
  std::vector<JoinedSegment> joined(segments.begin(), segments.end());
  for (JoinedSegment& one : joined) one.calibrated_on = false;
  const auto side = [&](std::span<const JoinedSegment> part) {
    const ThetaInformation information =
        InformationOfEvicted(rig, theta, part, options).information;
    Eigen::MatrixXd Lambda = directions.transpose() * scale.asDiagonal() *
                             information.Lambda(free, free) *
                             scale.asDiagonal() * directions;
    Lambda.diagonal().array() += 1;  // the prior's
    const Eigen::LLT<Eigen::MatrixXd> solver(Lambda);
    return Side{
        solver.solve(directions.transpose() *
                     scale.cwiseProduct(information.eta(free))),
        solver.solve(Eigen::MatrixXd::Identity(Lambda.rows(), Lambda.cols()))};
  };
  MemorySplit split;
  const std::vector<int> splits = SplitsOf(static_cast<int>(joined.size()));
  const std::vector<ParameterBlock> blocks = ParameterBlocks(rig);
  const auto tests = static_cast<double>(splits.size() * blocks.size());
  for (const int newer : splits) {
    const std::span<const JoinedSegment> all(joined);
    const Side before = side(all.first(all.size() - newer));
    const Side after = side(all.last(newer));
    const Eigen::VectorXd difference = after.mean - before.mean;
    const Eigen::MatrixXd information =
        (excess * (after.covariance + before.covariance)).inverse();
    for (const ParameterBlock& block : blocks) {
      const double probability =
          tests * ProbabilityOf(difference,
                                information,
                                directions.transpose() * block.basis);
      if (probability < split.probability) {
        split = {probability, newer, block.name};
      }
    }
  }
  return split;
}

}  // namespace selfcal
