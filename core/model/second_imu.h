// The second IMU of a rig as a body of its own: its frame J moves rigidly with
// I, so that every function of the states and the intrinsics of one IMU applies
// to it.
//
// The position of J in I is p_IJ = -R_JI^T p_JI, with T_JI of the calibration,
// and
//   q_GJ = q_GI q_JI^-1,   p_GJ = p_GI + R_GI p_IJ.
// Its readings have a time offset, so that by their clock a state is at t -
// time_offset_s. Its velocity and biases are separate unknowns of a keyframe:
// they follow from its own readings, and not from the rates of the first IMU at
// the time of the keyframe, which have the noise of single samples.
//
// Pure functions, callable from any thread.
#pragma once

#include <Eigen/Core>
#include <optional>

#include "core/model/calibration.h"
#include "core/model/rig.h"
#include "core/model/segment.h"

namespace selfcal {

// The IMUs are numbered from 0; 1 is the second one, which must exist.
inline int ImuCount(const Calibration& theta) { return theta.imu1 ? 2 : 1; }
const ImuCalibration& ImuOf(const Calibration& theta, int imu);
const ImuNoise& NoiseOfImu(const Rig& rig, int imu);
// Size of the tangent of a state, 15 for each IMU without the second pose.
inline int StateTangentSize(const Calibration& theta) {
  return theta.imu1 ? kStateTangentSize2 : kStateTangentSize;
}

// The state of an IMU, with its frame for I and the time by its clock, in whole
// nanoseconds; that of the first is x itself.
KeyframeState StateOfImu(const Calibration& theta,
                         int imu,
                         const KeyframeState& x);

// Derivative of the pose of the second IMU (q_GJ 3, p_GJ 3) with respect to
// that of a keyframe (q_GI 3, p_GI 3), and to its mount (q_JI 3, p_JI 3); that
// with respect to the time offset is in core/factor/imu_delay.h.
struct MountDerivatives {
  Eigen::Matrix<double, 6, 6> by_pose;
  Eigen::Matrix<double, 6, kMountPoseSize> by_mount;
};
MountDerivatives DerivativesOfMount(const SecondImuCalibration& imu,
                                    const KeyframeState& x);

// Starts the velocity of the second IMU and its biases at all keyframes of a
// segment, whose samples these are: the velocity by the rates of the first IMU,
// and constant biases by which the mean readings of both agree. `theta_s` is
// that of the segment; without a second IMU nothing happens.
void StartSecondImu(const Calibration& theta_s, MotionSegment* segment);

// A segment with these states. Without a second IMU it is the segment itself,
// not a copy, which must outlive this.
class StartedSegment {
 public:
  StartedSegment(const Calibration& theta_s, const MotionSegment& segment);

  const MotionSegment& operator*() const {
    return started_ ? *started_ : given_;
  }

 private:
  const MotionSegment& given_;
  std::optional<MotionSegment> started_;
};

}  // namespace selfcal
