// The path of the body through the exposures of a segment, as the readings give
// it: positions and velocities are linear in what readings do not say, the
// velocity at the beginning, gravity and an error of the accelerometer's bias.
//
// Frame B is the body at the first exposure or keyframe of the segment; B does
// not turn with it. Internal to core/motion. Pure, callable from any thread.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <vector>

#include "core/model/calibration.h"
#include "core/model/rig.h"
#include "core/model/segment.h"

namespace selfcal {

// The unknowns: v_B at the beginning [m/s], g_B [m/s^2], the error of b_a
// [m/s^2].
inline constexpr int kPathVelocity = 0;
inline constexpr int kPathGravity = 3;
inline constexpr int kPathAccelBias = 6;
inline constexpr int kPathUnknowns = 9;
using PathUnknowns = Eigen::Matrix<double, kPathUnknowns, 1>;
using PathMatrix = Eigen::Matrix<double, 3, kPathUnknowns>;

// The body at one instant: p_B = P x + p_0, v_B = V x + v_0.
struct PathNode {
  std::int64_t t_ns = 0;
  Eigen::Quaterniond q_BI = Eigen::Quaterniond::Identity();
  PathMatrix P = PathMatrix::Zero();
  Eigen::Vector3d p_0 = Eigen::Vector3d::Zero();
  PathMatrix V = PathMatrix::Zero();
  Eigen::Vector3d v_0 = Eigen::Vector3d::Zero();

  Eigen::Vector3d Position(const PathUnknowns& x) const { return P * x + p_0; }
  Eigen::Vector3d Velocity(const PathUnknowns& x) const { return V * x + v_0; }
};

class ExposurePath {
 public:
  // Times of keyframes and readings are those of the segment, exposures those
  // of the middle rows by theta.
  ExposurePath(const Rig& rig,
               const Calibration& theta,
               const MotionSegment& segment,
               const Eigen::Vector3d& b_a,
               const Eigen::Vector3d& b_g);

  const PathNode& Keyframe(int keyframe) const {
    return nodes_[keyframes_[keyframe]];
  }
  const PathNode& Exposure(int keyframe, int camera) const {
    return nodes_[exposures_[keyframe * cameras_ + camera]];
  }

 private:
  int cameras_;
  std::vector<PathNode> nodes_;  // in order of time
  std::vector<int> keyframes_;   // index of the node of each
  std::vector<int> exposures_;   // keyframe by keyframe
};

}  // namespace selfcal
