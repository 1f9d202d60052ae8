// Devices and segments as the theory of the tests in core/change assumes them:
// normal, linear, independent.
#pragma once

#include <Eigen/Cholesky>
#include <cstdint>
#include <random>
#include <vector>

#include "core/change/consistency.h"
#include "core/simulation/simulate.h"

namespace selfcal {

// The factory calibration with `share` of the variance of a reference segment;
// as in a result, components that the rig holds fixed have no variance.
inline KnownCalibration FactoryKnownTo(const Rig& rig, double share) {
  const std::vector<int> free = FreeComponents(rig);
  const Eigen::VectorXd sigmas = ReferenceSigmas(rig);
  Eigen::VectorXd variances = Eigen::VectorXd::Zero(sigmas.size());
  variances(free) = share * sigmas(free).cwiseAbs2();
  return {rig.factory, variances.asDiagonal()};
}

class RandomInformation {
 public:
  explicit RandomInformation(std::uint64_t seed) : random_(seed) {}

  Eigen::MatrixXd Normal(Eigen::Index rows, Eigen::Index cols) {
    return Eigen::MatrixXd::Zero(rows, cols).unaryExpr([this](double) {
      return normal_(random_);
    });
  }

  // A random direction of the estimated components in reference sigmas, as a
  // tangent.
  Eigen::VectorXd Direction(const Rig& rig) {
    const std::vector<int> free = FreeComponents(rig);
    const Eigen::VectorXd sigmas = ReferenceSigmas(rig);
    Eigen::VectorXd direction = Eigen::VectorXd::Zero(sigmas.size());
    direction(free) =
        Eigen::VectorXd(sigmas(free))
            .cwiseProduct(Eigen::VectorXd(
                              Normal(static_cast<Eigen::Index>(free.size()), 1))
                              .normalized());
    return direction;
  }

  // A random symmetric positive definite matrix, of about `strength` in units
  // of `sigmas`.
  Eigen::MatrixXd Definite(const Eigen::VectorXd& sigmas, double strength) {
    const Eigen::Index size = sigmas.size();
    const Eigen::MatrixXd A = Normal(size, 2 * size);
    const Eigen::VectorXd scale = sigmas.cwiseInverse();
    const Eigen::MatrixXd unit =
        strength / (2 * static_cast<double>(size)) * (A * A.transpose());
    return scale.asDiagonal() * unit * scale.asDiagonal();
  }

  // A segment of a device whose truth is theta0 [+] offset. It has no
  // information about components that the rig holds fixed.
  SegmentInformation Segment(const Rig& rig,
                             const Calibration& theta0,
                             const Eigen::VectorXd& offset,
                             double strength = 1) {
    SegmentInformation information;
    information.theta0 = theta0;
    const std::vector<int> free = FreeComponents(rig);
    const Eigen::VectorXd sigmas = ReferenceSigmas(rig);
    information.Lambda = Eigen::MatrixXd::Zero(sigmas.size(), sigmas.size());
    information.Lambda(free, free) = Definite(sigmas(free), strength);
    information.eta = information.Lambda * offset + Noise(information.Lambda);
    return information;
  }

  // Drawn from N(0, covariance); 0 where there is no variance.
  Eigen::VectorXd Noise(const Eigen::MatrixXd& covariance) {
    std::vector<int> varied;
    for (int i = 0; i < static_cast<int>(covariance.rows()); ++i) {
      if (covariance(i, i) > 0) varied.push_back(i);
    }
    const Eigen::MatrixXd block = covariance(varied, varied);
    Eigen::VectorXd noise = Eigen::VectorXd::Zero(covariance.rows());
    noise(varied) = block.llt().matrixL() * Normal(block.rows(), 1);
    return noise;
  }

 private:
  std::mt19937_64 random_;
  std::normal_distribution<double> normal_;
};

}  // namespace selfcal
