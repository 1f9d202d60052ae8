// Devices drawn from a normal distribution, and the information of each.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <cmath>
#include <random>
#include <vector>

#include "core/information/fusion.h"

namespace selfcal {

struct RandomCohort {
  RandomCohort(int size, double correlation, unsigned seed)
      : size(size), random(seed), mu(size), S(size, size) {
    const auto sigmas = Eigen::VectorXd::NullaryExpr(size, [&] {
      return std::exp(std::uniform_real_distribution(-3.5, -1.0)(random));
    });
    const Eigen::VectorXd sigma = sigmas;
    for (int i = 0; i < size; ++i) mu(i) = 0.5 * Normal();
    S.setConstant(correlation);
    S.diagonal().setOnes();
    S = (sigma.asDiagonal() * S * sigma.asDiagonal()).eval();
    root = S.llt().matrixL();
  }

  double Normal() { return std::normal_distribution()(random); }
  Eigen::VectorXd Normals(int count) {
    return Eigen::VectorXd::NullaryExpr(count, [&] { return Normal(); });
  }

  Eigen::VectorXd Draw() { return mu + root * Normals(size); }

  // What `rows` measurements with a noise of about `noise` tell of theta.
  ThetaInformation Measure(const Eigen::VectorXd& theta,
                           int rows,
                           double noise) {
    Eigen::MatrixXd J(rows, size);
    for (int i = 0; i < rows; ++i) J.row(i) = Normals(size).transpose() / noise;
    const Eigen::VectorXd values = J * theta + Normals(rows);
    return {J.transpose() * J, J.transpose() * values};
  }

  // Measured to about a third of the spread, and a few in less than all
  // directions.
  std::vector<ThetaInformation> Devices(int count) {
    std::vector<ThetaInformation> devices;
    for (int i = 0; i < count; ++i) {
      devices.push_back(
          Measure(Draw(), i % 4 == 3 ? size / 2 : 4 * size, 0.05));
    }
    return devices;
  }

  int size;
  std::mt19937 random;
  Eigen::VectorXd mu;
  Eigen::MatrixXd S;
  Eigen::MatrixXd root;
};

}  // namespace selfcal
