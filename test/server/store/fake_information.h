// Information with numbers out of a generator: what a store must keep, without
// the work of a score.
#pragma once

#include <random>

#include "core/information/segment_information.h"
#include "core/model/rig.h"

namespace selfcal::server {

// Entropy and gain of every group of the rig as given.
inline SegmentInformation FakeInformation(const Rig& rig,
                                          double entropy,
                                          double gain = 5.0,
                                          unsigned seed = 1) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  const auto draw = [&](auto) { return normal(random); };
  SegmentInformation information;
  const int size = TangentSize(rig.factory);
  information.theta0 = rig.factory;
  // So small that nothing is observed: what is not information of a device must
  // not pass for a change of it.
  information.Lambda = 1e-6 * Eigen::MatrixXd::Zero(size, size).unaryExpr(draw);
  information.eta = Eigen::VectorXd::Zero(size).unaryExpr(draw);
  information.rank = static_cast<int>(FreeComponents(rig).size()) - 1;
  information.unobserved = {{{{"imu.gyro.scale.x", 0.9}}, 0.1}};
  for (const ParameterGroup& group : rig.groups) {
    GroupScore score;
    score.group = group.name;
    score.size = static_cast<int>(GroupComponents(rig, group).size());
    score.entropy = entropy;
    score.gain = gain;
    score.rank = score.size - 1;
    score.unobserved = information.unobserved;
    information.groups.push_back(score);
  }
  information.residuals.observations = 100;
  information.residuals.inliers = 90;
  information.residuals.reprojection_rms_px = std::abs(normal(random));
  information.residuals.imu_gaps = 2;
  information.residuals.longest_imu_gap_s = 0.25;
  information.residuals.inertial_rms = {0.1, 0.2, 0.3, 0.4, 1.0 / 3};
  information.residuals.second_inertial_rms = {0.5, 0.6, 0.7, 0.8, 1.0 / 7};
  return information;
}

}  // namespace selfcal::server
