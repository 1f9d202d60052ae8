#include "core/calibration/subspace.h"

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <string>

#include "core/information/unobserved.h"
#include "core/model/symmetric_eigen.h"

namespace selfcal {
namespace {

// Prior sigmas, zero for components that the rig holds fixed.
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

// Eigenvalues in ascending order; empty for an empty matrix.
struct Spectrum {
  Eigen::VectorXd values;
  Eigen::MatrixXd directions;
};

Spectrum Decompose(const Eigen::MatrixXd& information) {
  if (information.size() == 0) {
    return {Eigen::VectorXd(0), information};
  }
  const SymmetricEigen eigen(information);
  return {eigen.eigenvalues(), eigen.eigenvectors()};
}

// Describes the held directions. One with some information from the data is
// described as one at the threshold.
std::vector<UnobservedDirection> NameHeld(const Rig& rig,
                                          const ThetaSubspace& subspace,
                                          const Eigen::MatrixXd& Lambda) {
  const std::vector<int> free = FreeComponents(rig);
  const Eigen::MatrixXd held = subspace.held(free, Eigen::all);
  const Eigen::MatrixXd estimated = subspace.estimated(free, Eigen::all);
  const Eigen::VectorXd sigmas = FreeSigmas(rig)(free);
  const Eigen::MatrixXd in_sigmas =
      sigmas.asDiagonal() * Lambda(free, free) * sigmas.asDiagonal();
  const Spectrum spectrum = Decompose(held.transpose() * in_sigmas * held);
  const Eigen::MatrixXd directions = held * spectrum.directions;
  return AnalyseObservability(
             directions *
                     spectrum.values.cwiseMin(kLeastInformation).asDiagonal() *
                     directions.transpose() +
                 estimated * estimated.transpose() / kLeastInformation,
             FreeNames(rig))
      .unobserved;
}

// Orthonormal basis of the complement of `part` within the span of `whole`.
Eigen::MatrixXd Complement(const Eigen::MatrixXd& whole,
                           const Eigen::MatrixXd& part) {
  if (part.cols() == 0) {
    return whole;
  }
  const Eigen::MatrixXd inside = whole.transpose() * part;
  const Eigen::HouseholderQR<Eigen::MatrixXd> qr(inside);
  const Eigen::MatrixXd Q = qr.householderQ();
  return whole * Q.rightCols(whole.cols() - part.cols());
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
                               int min_held,
                               double least_information) {
  const ThetaSubspace whole = WholeSubspace(rig);
  const Spectrum spectrum = Decompose(Reduced(rig, whole, Lambda));
  const Eigen::MatrixXd directions = whole.estimated * spectrum.directions;
  const auto size = static_cast<int>(directions.cols());
  int held = std::min(min_held, size);
  while (held < size && spectrum.values(held) < least_information) {
    ++held;
  }
  ThetaSubspace subspace;
  subspace.held = directions.leftCols(held);
  subspace.estimated = directions.rightCols(size - held);
  subspace.unobserved = NameHeld(rig, subspace, Lambda);
  return subspace;
}

ThetaSubspace HoldDirections(const Rig& rig,
                             const Eigen::MatrixXd& Lambda,
                             const Eigen::MatrixXd& held) {
  ThetaSubspace subspace;
  subspace.estimated = Complement(WholeSubspace(rig).estimated, held);
  const Spectrum spectrum = Decompose(Reduced(rig, subspace, Lambda));
  const auto weak = (spectrum.values.array() < kLeastInformation).count();
  const Eigen::MatrixXd directions = subspace.estimated * spectrum.directions;
  subspace.held.resize(held.rows(), held.cols() + weak);
  subspace.held << held, directions.leftCols(weak);
  subspace.estimated = directions.rightCols(directions.cols() - weak);
  subspace.unobserved = NameHeld(rig, subspace, Lambda);
  return subspace;
}

Eigen::MatrixXd TangentBasis(const Rig& rig, const ThetaSubspace& subspace) {
  return FreeSigmas(rig).asDiagonal() * subspace.estimated;
}

Eigen::MatrixXd Reduced(const Rig& rig,
                        const ThetaSubspace& subspace,
                        const Eigen::MatrixXd& Lambda) {
  const Eigen::MatrixXd basis = TangentBasis(rig, subspace);
  return basis.transpose() * Lambda * basis;
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

Eigen::MatrixXd HeldSteps(const Rig& rig,
                          const ThetaSubspace& subspace,
                          const Eigen::MatrixXd& Lambda) {
  const Eigen::MatrixXd held = FreeSigmas(rig).asDiagonal() * subspace.held;
  if (subspace.held.cols() == 0 || subspace.estimated.cols() == 0) return held;
  const Eigen::MatrixXd basis = TangentBasis(rig, subspace);
  const Eigen::MatrixXd leaning =
      basis * Reduced(rig, subspace, Lambda)
                  .ldlt()
                  .solve(basis.transpose() * (Lambda * held));
  return held - leaning;
}

Eigen::MatrixXd CovarianceWithHeld(const Rig& rig,
                                   const ThetaSubspace& subspace,
                                   const Eigen::MatrixXd& Lambda) {
  Eigen::MatrixXd covariance = SubspaceCovariance(rig, subspace, Lambda);
  if (subspace.held.cols() == 0 || subspace.estimated.cols() == 0) {
    return covariance;
  }
  const Eigen::MatrixXd held = FreeSigmas(rig).asDiagonal() * subspace.held;
  const Eigen::MatrixXd off = HeldSteps(rig, subspace, Lambda);
  covariance += off * off.transpose() - held * held.transpose();
  if (subspace.bends.cols() > 0) {
    covariance += subspace.bends * subspace.bends.transpose();
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
