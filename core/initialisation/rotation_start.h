// A start for the calibration of a camera to an IMU from feature tracks and the
// gyroscope alone: the rotation between both, the time offset, the bias of the
// gyroscope, and a common scale of the focal lengths. None of them needs to be
// known before.
//
// Two images give the rotation of the camera between them, at least roughly,
// from the rays of their points alone. The rotation q_CI and the time offset
// are those for which these are the rotations of the gyroscope (Wahba's problem
// at each offset). From there, everything is refined together: the matches of a
// pair of images lie in epipolar planes of one direction of translation, with
// the rotation that the gyroscope measured. Since an angle between rays depends
// on the focal length and the gyroscope's does not, the focal length follows.
//
// Not estimated: principal point, distortion, the position of the camera, and
// the scales of the gyroscope. What these are wrong by is not in the
// covariance.
//
// Pure, deterministic, callable from any thread.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/model/calibration.h"
#include "core/model/segment.h"

namespace selfcal {

struct TrackedPoint {
  std::uint64_t landmark = 0;
  Eigen::Vector2d z_px = Eigen::Vector2d::Zero();
};

// An image of one camera.
struct TrackedImage {
  std::int64_t t_ns = 0;  // on the camera's own clock
  std::vector<TrackedPoint> points;
};

struct RotationSearch {
  // True: any q_CI is possible. False: that of the camera is right within
  // rotation_sigma_rad, a standard deviation on each axis.
  bool search_rotation = true;
  double rotation_sigma_rad = 0.17;
  // Range of the time offset about that of the camera, of either sign.
  double max_time_offset_s = 0.15;
  // True if f of the camera is a guess, whose logarithm is right within
  // focal_sigma.
  bool estimate_focal_scale = false;
  double focal_sigma = 0.3;
};

// Order of the covariance.
inline constexpr int kStartRotation = 0;  // of q_CI, perturbed on the right
inline constexpr int kStartTimeOffset = 3;
inline constexpr int kStartGyroBias = 4;
inline constexpr int kStartFocalScale = 7;  // of its logarithm
inline constexpr int kStartSize = 8;

struct RotationStart {
  Eigen::Quaterniond q_CI = Eigen::Quaterniond::Identity();
  double time_offset_s = 0;                       // as of CameraCalibration
  Eigen::Vector3d b_g = Eigen::Vector3d::Zero();  // [rad/s], mean, in I
  double focal_scale = 1;  // f is that of the camera times this
  // Units are rad, s, rad/s and 1; zero for a focal scale that is not
  // estimated. It is that of the scatter of the pairs of images, not of a
  // stated noise; with outliers or errors that are correlated along tracks,
  // sigmas are too small by about a seventh.
  Eigen::Matrix<double, kStartSize, kStartSize> covariance =
      Eigen::Matrix<double, kStartSize, kStartSize>::Zero();
  // Share of the mean square of the camera's rotations that the gyroscope
  // explains.
  double explained = 0;
  // Robust standard deviation of the points' distances from their epipolar
  // planes. Several pixels with good tracks: the model of the camera is wrong.
  double residual_px = 0;

  double Sigma(int component) const;  // of the covariance
};

// Either a start, or the reason why there is none, a sentence for people.
struct RotationStartResult {
  std::optional<RotationStart> start;
  std::string reason;
};

// `images` and `samples` are in order of time; an image or a sample that is not
// later than the one before is ignored. Rotations and angular rates must vary:
// a few seconds of vigorous motion about at least two axes suffice. Of the
// camera, q_CI and p_CI are not used in a search; of the IMU, only the matrix
// of the gyroscope is. A line delay of the camera is used as it is.
//
// There is none for too few images, matches, or readings; without rotation, or
// with rotation about one axis only if q_CI is unknown; at a constant rate; and
// if images and gyroscope do not agree at any time offset, agree at two of
// them, or at one outside the range.
RotationStartResult FindRotationStart(const CameraCalibration& camera,
                                      const ImuCalibration& imu,
                                      std::span<const TrackedImage> images,
                                      std::span<const ImuSample> samples,
                                      const RotationSearch& options = {});

}  // namespace selfcal
