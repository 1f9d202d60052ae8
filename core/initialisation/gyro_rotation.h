// Rotation of the body between two instants, as the gyroscope measured it, with
// its derivative with respect to the bias.
//
// Not synchronised: one thread at a time.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <optional>
#include <vector>

#include "core/model/calibration.h"
#include "core/model/segment.h"

namespace selfcal {

class GyroRotation {
 public:
  // Readings are corrected by the matrix of the calibration and this bias
  // [rad/s].
  explicit GyroRotation(const ImuCalibration& imu,
                        const Eigen::Vector3d& b_g = Eigen::Vector3d::Zero());

  // Times must increase; a sample that is not later than the last one is
  // ignored.
  void Add(const ImuSample& sample);

  // Forgets what is not needed for times from t_s on.
  void DropBefore(double t_s);

  // R_AB, with A the body at from_s and B the body at to_s, on the clock of the
  // IMU [s]. The rate is linear between samples, and beyond them that of the
  // nearest one. The identity without samples.
  Eigen::Quaterniond Between(double from_s, double to_s) const;

  // R_0B, with 0 the body at the first sample; nullopt without samples.
  std::optional<Eigen::Quaterniond> OrientationAt(double t_s) const;

  // Angular rate of the body [rad/s], in I.
  Eigen::Vector3d RateAt(double t_s) const;

  // Derivative of R_AB, perturbed on the right, with respect to the bias.
  Eigen::Matrix3d BetweenByBias(double from_s, double to_s) const;

 private:
  struct Node {
    double t_s;
    Eigen::Vector3d w_I;
    Eigen::Quaterniond q;  // R_0B with the body 0 at the first sample
    Eigen::Matrix3d sum;   // integral of R_0B [s]
  };

  // Turns node->q and node->sum on from those of `from`, at a mean rate.
  static void Advance(const Node& from, const Eigen::Vector3d& w_I, Node* node);
  // The last node at or before a time, or the first one; there must be one.
  std::vector<Node>::const_iterator Before(double t_s) const;
  // The body at t_s; its `w_I` is the rate there.
  Node At(double t_s) const;

  Eigen::Matrix3d T_g_inverse_;
  Eigen::Vector3d b_g_;
  std::vector<Node> nodes_;
};

}  // namespace selfcal
