#include "core/motion/exposure_path.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "core/factor/preintegration.h"
#include "core/model/camera.h"

namespace selfcal {
namespace {

PathNode Next(const PathNode& from, const Preintegration& step) {
  const double dt = step.dt_s;
  const Eigen::Matrix3d R = from.q_BI.toRotationMatrix();
  PathNode to;
  to.q_BI = (from.q_BI * step.Delta_R).normalized();
  to.P = from.P + dt * from.V;
  to.p_0 = from.p_0 + dt * from.v_0 + R * step.Delta_p;
  to.V = from.V;
  to.v_0 = from.v_0 + R * step.Delta_v;
  to.P.middleCols<3>(kPathGravity).diagonal().array() += dt * dt / 2;
  to.V.middleCols<3>(kPathGravity).diagonal().array() += dt;
  to.P.middleCols<3>(kPathAccelBias) += R * step.J_bias.block<3, 3>(6, 0);
  to.V.middleCols<3>(kPathAccelBias) += R * step.J_bias.block<3, 3>(3, 0);
  return to;
}

}  // namespace

ExposurePath::ExposurePath(const Rig& rig,
                           const Calibration& theta,
                           const MotionSegment& segment,
                           const Eigen::Vector3d& b_a,
                           const Eigen::Vector3d& b_g)
    : cameras_(static_cast<int>(theta.cameras.size())) {
  std::vector<std::int64_t> keyframe_ns, exposure_ns;
  for (const KeyframeState& x : segment.keyframes) {
    keyframe_ns.push_back(x.t_ns);
    for (const CameraCalibration& camera : theta.cameras) {
      exposure_ns.push_back(
          x.t_ns +
          std::llround(1e9 * MiddleRowDelay(camera, SessionTime(segment, x))));
    }
  }
  std::vector<std::int64_t> times_ns = keyframe_ns;
  times_ns.insert(times_ns.end(), exposure_ns.begin(), exposure_ns.end());
  std::sort(times_ns.begin(), times_ns.end());
  times_ns.erase(std::unique(times_ns.begin(), times_ns.end()), times_ns.end());

  PathNode node;
  node.t_ns = times_ns.front();
  node.V.middleCols<3>(kPathVelocity).setIdentity();
  nodes_.push_back(node);
  for (std::size_t i = 1; i < times_ns.size(); ++i) {
    node = Next(node,
                Preintegrate(segment.imu,
                             times_ns[i - 1],
                             times_ns[i],
                             theta.imu,
                             b_a,
                             b_g,
                             rig.imu_noise,
                             {.jacobians = true, .covariance = false}));
    node.t_ns = times_ns[i];
    nodes_.push_back(node);
  }
  const auto index_of = [&](std::int64_t t_ns) {
    return static_cast<int>(
        std::lower_bound(times_ns.begin(), times_ns.end(), t_ns) -
        times_ns.begin());
  };
  for (const std::int64_t t_ns : keyframe_ns) {
    keyframes_.push_back(index_of(t_ns));
  }
  for (const std::int64_t t_ns : exposure_ns) {
    exposures_.push_back(index_of(t_ns));
  }
}

}  // namespace selfcal
