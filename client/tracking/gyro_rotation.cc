#include "client/tracking/gyro_rotation.h"

#include <Eigen/LU>
#include <algorithm>

#include "core/model/so3.h"

namespace selfcal::client {

GyroRotation::GyroRotation(const ImuCalibration& imu,
                           const Eigen::Vector3d& b_g)
    : T_g_inverse_(imu.T_g().inverse()), b_g_(b_g) {}

void GyroRotation::Add(const ImuSample& sample) {
  Node node{static_cast<double>(sample.t_ns) * 1e-9,
            T_g_inverse_ * (sample.gyro - b_g_),
            Eigen::Quaterniond::Identity()};
  if (!nodes_.empty()) {
    const Node& last = nodes_.back();
    const double dt_s = node.t_s - last.t_s;
    if (!(dt_s > 0)) return;
    node.q = (last.q * Exp(0.5 * dt_s * (last.w_I + node.w_I))).normalized();
  }
  nodes_.push_back(node);
}

void GyroRotation::DropBefore(double t_s) {
  auto keep = std::upper_bound(
      nodes_.begin(), nodes_.end(), t_s, [](double t, const Node& node) {
        return t < node.t_s;
      });
  if (keep != nodes_.begin()) nodes_.erase(nodes_.begin(), keep - 1);
}

Eigen::Quaterniond GyroRotation::Between(double from_s, double to_s) const {
  if (nodes_.empty()) return Eigen::Quaterniond::Identity();
  return At(from_s).conjugate() * At(to_s);
}

Eigen::Quaterniond GyroRotation::At(double t_s) const {
  const auto after = std::upper_bound(
      nodes_.begin(), nodes_.end(), t_s, [](double t, const Node& node) {
        return t < node.t_s;
      });
  const Node& a = after == nodes_.begin() ? nodes_.front() : *(after - 1);
  const double dt_s = t_s - a.t_s;
  Eigen::Vector3d rate = a.w_I;
  if (after != nodes_.begin() && after != nodes_.end()) {
    // Mean rate from a to t_s.
    rate += 0.5 * dt_s / (after->t_s - a.t_s) * (after->w_I - a.w_I);
  }
  return a.q * Exp(dt_s * rate);
}

}  // namespace selfcal::client
