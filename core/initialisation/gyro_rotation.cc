#include "core/initialisation/gyro_rotation.h"

#include <Eigen/LU>
#include <algorithm>

#include "core/model/so3.h"

namespace selfcal {

GyroRotation::GyroRotation(const ImuCalibration& imu,
                           const Eigen::Vector3d& b_g)
    : T_g_inverse_(imu.T_g().inverse()), b_g_(b_g) {}

void GyroRotation::Add(const ImuSample& sample) {
  Node node{static_cast<double>(sample.t_ns) * 1e-9,
            T_g_inverse_ * (sample.gyro - b_g_),
            Eigen::Quaterniond::Identity(),
            Eigen::Matrix3d::Zero()};
  if (!nodes_.empty()) {
    const Node& last = nodes_.back();
    if (!(node.t_s > last.t_s)) return;
    Advance(last, 0.5 * (last.w_I + node.w_I), &node);
  }
  nodes_.push_back(node);
}

void GyroRotation::Advance(const Node& from,
                           const Eigen::Vector3d& w_I,
                           Node* node) {
  const double dt_s = node->t_s - from.t_s;
  const Eigen::Quaterniond middle = from.q * Exp(0.5 * dt_s * w_I);
  node->q = (from.q * Exp(dt_s * w_I)).normalized();
  node->sum = from.sum + dt_s * middle.toRotationMatrix();
}

void GyroRotation::DropBefore(double t_s) {
  if (!nodes_.empty()) nodes_.erase(nodes_.begin(), Before(t_s));
}

Eigen::Quaterniond GyroRotation::Between(double from_s, double to_s) const {
  if (nodes_.empty()) return Eigen::Quaterniond::Identity();
  return At(from_s).q.conjugate() * At(to_s).q;
}

std::optional<Eigen::Quaterniond> GyroRotation::OrientationAt(
    double t_s) const {
  if (nodes_.empty()) return std::nullopt;
  return At(t_s).q;
}

Eigen::Vector3d GyroRotation::RateAt(double t_s) const {
  if (nodes_.empty()) return Eigen::Vector3d::Zero();
  return At(t_s).w_I;
}

Eigen::Matrix3d GyroRotation::BetweenByBias(double from_s, double to_s) const {
  if (nodes_.empty()) return Eigen::Matrix3d::Zero();
  const Node to = At(to_s);
  return to.q.conjugate() * (At(from_s).sum - to.sum) * T_g_inverse_;
}

std::vector<GyroRotation::Node>::const_iterator GyroRotation::Before(
    double t_s) const {
  const auto after = std::upper_bound(
      nodes_.begin(), nodes_.end(), t_s, [](double t, const Node& node) {
        return t < node.t_s;
      });
  return after == nodes_.begin() ? after : after - 1;
}

GyroRotation::Node GyroRotation::At(double t_s) const {
  const auto before = Before(t_s);
  const auto after = before + 1;
  const double dt_s = t_s - before->t_s;
  Node node{t_s, before->w_I, before->q, before->sum};
  Eigen::Vector3d mean = before->w_I;  // rate from `before` to t_s
  if (dt_s > 0 && after != nodes_.end()) {
    const Eigen::Vector3d slope =
        (after->w_I - before->w_I) / (after->t_s - before->t_s);
    node.w_I += dt_s * slope;
    mean += 0.5 * dt_s * slope;
  }
  Advance(*before, mean, &node);
  return node;
}

}  // namespace selfcal
