// The motion of the body about a keyframe, as measured by the IMU: it moves the
// keyframe's pose to the instant at which a camera was exposed, if the camera's
// clock has an offset from that of the IMU, and each row of an image to its
// own, if the shutter is a rolling one (CameraCalibration).
//
// The samples between the keyframe's time and the exposure are integrated with
// the current estimate. The result is a constant while factors are linearised
// at that estimate; the pose then depends on the offset alone,
//   q_GI(t + dt) = q_GI turn Exp(w_I (dt - dt0)),
//   p_GI(t + dt) = p_GI + R_GI (shift_I + v_I (dt - dt0)).
// Of a rolling shutter, t + dt0 is the middle row, and from there on the motion
// is a cubic polynomial of time (ReadoutMotion). It is expressed in the body
// frame, so that a common translation of the keyframes of a problem, or
// rotation about gravity, changes nothing. Residuals have exact derivatives
// with respect to the pose and the offset, and none with respect to biases,
// velocity and IMU intrinsics through the motion. The neglected terms are small
// (a velocity error of 1 cm/s moves the camera by 0.2 mm in 20 ms), and do not
// bias the estimate: the motion is measured again at each new estimate, where
// the residuals are those of the complete model; only terms weighted by the
// residuals at the optimum are neglected.
//
// Pure functions, callable from any thread.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <span>
#include <vector>

#include "core/model/calibration.h"
#include "core/model/rig.h"
#include "core/model/segment.h"

namespace selfcal {

// Motion of the body while a rolling shutter reads an image, as measured: in
// the time s after the exposure of the middle row it turns by Exp(phi) and
// moves by p, in its frame there, with
//   phi = turn (s, s^2, s^3)^T,   p = shift (s, s^2, s^3)^T.
// The values are those of the integrated samples at both ends of the readout,
// and the slopes those in its middle.
struct ReadoutMotion {
  Eigen::Matrix3d turn = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d shift = Eigen::Matrix3d::Zero();
  // Share of the angular rate that counts in derivatives, in [0, 1]: zero if it
  // is not significant relative to the noise of the gyroscope.
  double rate_share = 1;
};

// Facts about a keyframe beside its state.
struct KeyframeContext {
  std::span<const ImuSample> samples;  // about its time
  double session_s = 0;                // its time since the session began
};

KeyframeContext ContextOf(const MotionSegment& segment, std::size_t keyframe);

// Motion about the time dt_s after that of the keyframe.
struct KeyframeMotion {
  double dt_s = 0;
  Eigen::Quaterniond turn = Eigen::Quaterniond::Identity();
  Eigen::Vector3d shift_I = Eigen::Vector3d::Zero();  // [m], in I at t
  Eigen::Vector3d w_I = Eigen::Vector3d::Zero();      // [rad/s], in I there
  Eigen::Vector3d v_I = Eigen::Vector3d::Zero();      // [m/s], in I at t
  // The motion after dt_s, used with a rolling shutter alone.
  ReadoutMotion readout = {};
  double session_s = 0;  // time of the keyframe since the session began
};

// Measures the motion from the samples about the keyframe, in order of time, at
// least one, with the biases of the state. Beyond the first and the last sample
// it extrapolates the line through the nearest ones, but not far. The rate w_I
// is shrunk to zero if it is not significant relative to the noise of the
// gyroscope: otherwise the offset would seem observable for a device at rest.
KeyframeMotion MeasureMotion(std::span<const ImuSample> samples,
                             const KeyframeState& x,
                             const ImuCalibration& imu,
                             const ImuNoise& noise,
                             double gravity_mps2,
                             double dt_s);

// The same for a camera: to its exposure, or to that of its middle row with the
// motion while it reads an image.
KeyframeMotion MeasureMotion(const KeyframeContext& context,
                             const KeyframeState& x,
                             const ImuCalibration& imu,
                             const ImuNoise& noise,
                             double gravity_mps2,
                             const CameraCalibration& camera);

// Pose of the body at the exposure, and its derivatives: those of the tangent
// of that pose (rotation 3, position 3) with respect to the rotation of the
// keyframe, and to the time of the exposure. The derivative with respect to the
// keyframe's position is (0, 1).
struct ExposurePose {
  Eigen::Quaterniond q_GI;
  Eigen::Vector3d p_GI;
  Eigen::Matrix<double, 6, 3> by_rotation;
  Eigen::Matrix<double, 6, 1> by_time;
};

ExposurePose MovePose(const Eigen::Quaterniond& q_GI,
                      const Eigen::Vector3d& p_GI,
                      const KeyframeMotion& motion,
                      double exposure_s);
// The same for the exposure of a pixel, with a rolling shutter or without.
ExposurePose MovePose(const Eigen::Quaterniond& q_GI,
                      const Eigen::Vector3d& p_GI,
                      const KeyframeMotion& motion,
                      const CameraCalibration& camera,
                      const Eigen::Vector2d& z_px);

// The pose without a motion; nothing depends on the time.
ExposurePose PoseAtRest(const Eigen::Quaterniond& q_GI,
                        const Eigen::Vector3d& p_GI);

// The motions of all keyframes, for those cameras that need them. A new
// measurement reuses the memory.
class KeyframeMotions {
 public:
  // Null if the camera is exposed at the keyframe's time, and this is known.
  const KeyframeMotion* At(int keyframe, int camera) const {
    if (index_.empty() || index_[camera] < 0) return nullptr;
    return &motions_[keyframe * stride_ + index_[camera]];
  }

  // `estimated` is nonzero for each camera whose offset is estimated;
  // theta_of(k) is theta_s of keyframe k (temperature.h), and context(k) its
  // context.
  template <typename ThetaOf, typename Context>
  void Measure(const Rig& rig,
               const ThetaOf& theta_of,
               std::span<const char> estimated,
               std::span<const KeyframeState> keyframes,
               const Context& context) {
    index_.clear();
    if (keyframes.empty()) return;
    FindCameras(theta_of(0), estimated);
    if (index_.empty()) return;
    motions_.resize(keyframes.size() * stride_);
    for (std::size_t k = 0; k < keyframes.size(); ++k) {
      const Calibration& theta = theta_of(k);
      for (std::size_t j = 0; j < index_.size(); ++j) {
        if (index_[j] < 0) continue;
        motions_[k * stride_ + index_[j]] = MeasureMotion(context(k),
                                                          keyframes[k],
                                                          theta.imu,
                                                          rig.imu_noise,
                                                          rig.gravity_mps2,
                                                          theta.cameras[j]);
      }
    }
  }

  // One theta for all keyframes.
  template <typename Context>
  void Measure(const Rig& rig,
               const Calibration& theta,
               std::span<const char> estimated,
               std::span<const KeyframeState> keyframes,
               const Context& context) {
    const auto same = [&](std::size_t) -> const Calibration& { return theta; };
    Measure(rig, same, estimated, keyframes, context);
  }

 private:
  void FindCameras(const Calibration& theta, std::span<const char> estimated);

  std::vector<int> index_;  // by camera; empty if no camera needs motions
  int stride_ = 0;
  std::vector<KeyframeMotion> motions_;
};

// `theta` is theta_s of the segment (temperature.h).
KeyframeMotions SegmentMotions(const Rig& rig,
                               const Calibration& theta,
                               const MotionSegment& segment);

}  // namespace selfcal
