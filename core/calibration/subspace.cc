#include "core/calibration/subspace.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <string>

#include "core/information/unobserved.h"

namespace selfcal {
namespace {

// Just below an information of 1, by more than rounding: where the prior is
// part of the information, it is 1 without any data.
constexpr double kAtThreshold = 1 - 1e-4;

// Prior sigmas, zero for what the rig holds fixed.
Eigen::VectorXd FreeSigmas(const Rig& rig) {
  const Eigen::VectorXd all = PriorSigmas(rig);
  Eigen::VectorXd sigmas = Eigen::VectorXd::Zero(all.size());
  for (const int i : FreeComponents(rig)) {
    sigmas(i) = all(i);
  }
  return sigmas;
}

std::vector<std::string> FreeNames(const Rig& rig) {
  const std::vector<TangentComponent> components =
      TangentComponents(rig.factory);
  std::vector<std::string> names;
  for (const int i : FreeComponents(rig)) {
    names.push_back(components[i].name);
  }
  return names;
}

// Lambda on the estimated subspace, r x r, in units of the prior.
Eigen::MatrixXd Reduced(const Rig& rig,
                        const ThetaSubspace& subspace,
                        const Eigen::MatrixXd& Lambda) {
  const Eigen::MatrixXd basis = TangentBasis(rig, subspace);
  return basis.transpose() * Lambda * basis;
}

}  // namespace

ThetaSubspace WholeSubspace(const Rig& rig) {
  const std::vector<int> free = FreeComponents(rig);
  const int size = TangentSize(rig.factory);
  ThetaSubspace subspace;
  subspace.estimated = Eigen::MatrixXd::Zero(size, free.size());
  for (std::size_t j = 0; j < free.size(); ++j) {
    subspace.estimated(free[j], static_cast<int>(j)) = 1;
  }
  subspace.held.resize(size, 0);
  return subspace;
}

ThetaSubspace ObservedSubspace(const Rig& rig,
                               const Eigen::MatrixXd& Lambda,
                               int min_held) {
  const ThetaSubspace whole = WholeSubspace(rig);
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(
      Reduced(rig, whole, Lambda));
  const Eigen::MatrixXd directions = whole.estimated * eigen.eigenvectors();
  const auto size = static_cast<int>(directions.cols());
  int held = std::min(min_held, size);
  while (held < size && eigen.eigenvalues()(held) < kAtThreshold) {
    ++held;
  }
  ThetaSubspace subspace;
  subspace.held = directions.leftCols(held);
  subspace.estimated = directions.rightCols(size - held);
  // A direction that is held because it once was unobserved is named with the
  // others, as one at the threshold.
  Eigen::VectorXd information = eigen.eigenvalues();
  information.head(held) = information.head(held).cwiseMin(kAtThreshold);
  information.tail(size - held) =
      information.tail(size - held).cwiseMax(1 / kAtThreshold);
  subspace.unobserved =
      AnalyseObservability(eigen.eigenvectors() * information.asDiagonal() *
                               eigen.eigenvectors().transpose(),
                           FreeNames(rig))
          .unobserved;
  return subspace;
}

Eigen::MatrixXd TangentBasis(const Rig& rig, const ThetaSubspace& subspace) {
  return FreeSigmas(rig).asDiagonal() * subspace.estimated;
}

Eigen::VectorXd ProjectOnSubspace(const Rig& rig,
                                  const ThetaSubspace& subspace,
                                  const Eigen::VectorXd& step) {
  const Eigen::VectorXd in_sigmas = step.cwiseQuotient(PriorSigmas(rig));
  return TangentBasis(rig, subspace) *
         (subspace.estimated.transpose() * in_sigmas);
}

Eigen::MatrixXd SubspaceCovariance(const Rig& rig,
                                   const ThetaSubspace& subspace,
                                   const Eigen::MatrixXd& Lambda) {
  const Eigen::MatrixXd basis = TangentBasis(rig, subspace);
  const Eigen::MatrixXd held = FreeSigmas(rig).asDiagonal() * subspace.held;
  Eigen::MatrixXd covariance = held * held.transpose();
  if (basis.cols() > 0) {
    const Eigen::LDLT<Eigen::MatrixXd> ldlt(Reduced(rig, subspace, Lambda));
    covariance += basis * ldlt.solve(basis.transpose());
  }
  return (covariance + covariance.transpose()) / 2;
}

Eigen::VectorXd SubspaceStep(const Rig& rig,
                             const ThetaSubspace& subspace,
                             const Eigen::MatrixXd& Lambda,
                             const Eigen::VectorXd& eta) {
  const Eigen::MatrixXd basis = TangentBasis(rig, subspace);
  if (basis.cols() == 0) {
    return Eigen::VectorXd::Zero(eta.size());
  }
  const Eigen::LDLT<Eigen::MatrixXd> ldlt(Reduced(rig, subspace, Lambda));
  return basis * ldlt.solve(basis.transpose() * eta);
}

double LargestInSigmas(const Eigen::VectorXd& step,
                       const Eigen::MatrixXd& covariance) {
  double largest = 0;
  for (int i = 0; i < step.size(); ++i) {
    if (covariance(i, i) > 0) {
      largest =
          std::max(largest, std::abs(step(i)) / std::sqrt(covariance(i, i)));
    }
  }
  return largest;
}

}  // namespace selfcal
