// Devices and segments as the theory of the tests in core/change assumes them:
// normal, linear, independent.
#pragma once

#include <Eigen/Cholesky>
#include <cstdint>
#include <random>

#include "core/change/consistency.h"
#include "core/simulation/simulate.h"

namespace selfcal {

class RandomInformation {
 public:
  explicit RandomInformation(std::uint64_t seed) : random_(seed) {}

  Eigen::MatrixXd Normal(Eigen::Index rows, Eigen::Index cols) {
    return Eigen::MatrixXd::Zero(rows, cols).unaryExpr([this](double) {
      return normal_(random_);
    });
  }

  // A direction of theta in reference sigmas, as a tangent.
  Eigen::VectorXd Direction(const Rig& rig) {
    const Eigen::VectorXd sigmas = ReferenceSigmas(rig);
    return sigmas.cwiseProduct(
        Eigen::VectorXd(Normal(sigmas.size(), 1)).normalized());
  }

  // Symmetric, definite, about `strength` in units of `sigmas`, mixed at
  // random.
  Eigen::MatrixXd Definite(const Eigen::VectorXd& sigmas, double strength) {
    const Eigen::Index size = sigmas.size();
    const Eigen::MatrixXd A = Normal(size, 2 * size);
    const Eigen::VectorXd scale = sigmas.cwiseInverse();
    const Eigen::MatrixXd unit =
        strength / (2 * static_cast<double>(size)) * (A * A.transpose());
    return scale.asDiagonal() * unit * scale.asDiagonal();
  }

  // A segment of a device whose truth is theta0 [+] offset.
  SegmentInformation Segment(const Rig& rig,
                             const Calibration& theta0,
                             const Eigen::VectorXd& offset,
                             double strength = 1) {
    SegmentInformation information;
    information.theta0 = theta0;
    information.Lambda = Definite(ReferenceSigmas(rig), strength);
    information.eta = information.Lambda * offset + Noise(information.Lambda);
    return information;
  }

  // Drawn from N(0, covariance).
  Eigen::VectorXd Noise(const Eigen::MatrixXd& covariance) {
    return covariance.llt().matrixL() * Normal(covariance.rows(), 1);
  }

 private:
  std::mt19937_64 random_;
  std::normal_distribution<double> normal_;
};

}  // namespace selfcal
