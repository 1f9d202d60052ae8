// Simulates a device with known truth: sensors on a trajectory, and the
// keyframe states as a SLAM system with a wrong calibration would hand them
// over.
//
// Deterministic: the same options and seed give the same bits. Pure functions,
// callable from any thread.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/model/calibration.h"
#include "core/model/rig.h"
#include "core/model/segment.h"
#include "core/simulation/trajectory.h"

namespace selfcal {

struct SimulationOptions {
  std::uint64_t seed = 1;
  double imu_rate_hz = 200;
  double keyframe_rate_hz = 10;
  int keyframes_per_segment = 40;
  int landmarks_in_view =
      120;  // approximate number for each keyframe and camera
  // Mean number of consecutive keyframes that observe a landmark, geometrically
  // distributed, unless it leaves the image before, or reaches the maximum.
  double mean_track_length = 10;
  int max_track_length = 1'000'000;
  // Fraction of new tracks on landmarks that were observed before, as
  // recognised by a map.
  double revisit_fraction = 0.1;
  double min_depth_m = 0.5;  // of a landmark at its first observation
  double max_depth_m = 8;
  double outlier_fraction = 0;  // observations replaced by a random pixel
  // Fraction of new landmarks that move through the scene on a straight line,
  // like objects that a tracker follows although they are not part of it. In
  // the truth they are at rest.
  double moving_fraction = 0;
  double moving_speed_mps = 0.3;
  // Correlation of the pixel error of a track with that in the previous
  // keyframe, in [0, 1): real trackers drift, so that errors are correlated
  // along a track.
  double pixel_correlation = 0;
  // Part of the variance of the pixel error that the observations of a track
  // have in common, all but the first of its landmark, which has no error: that
  // of the patch with which it began.
  double pixel_shared = 0;
  // Degrees of freedom of Student's distribution of pixel errors, of which a
  // track has one scale: most patches are good ones. 0: normal errors.
  double pixel_freedom = 0;
  // Exposure time. Points that move in the image during it are blurred, and
  // detected with an additional error along the blur of blur_error times its
  // length, one standard deviation.
  double exposure_s = 0;
  double blur_error = 0.15;
  bool noise = true;  // false: perfect sensors, constant biases
  // Fraction of IMU samples that are lost independently; and the length of a
  // gap somewhere in each segment. The first and the last sample of a segment
  // are never lost.
  double imu_lost_fraction = 0;
  double imu_gap_s = 0;
  // Time before its first and after its last keyframe of which a segment has
  // the samples, within the trajectory: there none is lost.
  double imu_padding_s = kImuPadding_s;
  // Time from the begin of the session to that of the trajectory.
  double session_age_s = 0;
  // Temperature of the device [deg C], which its segments state; without one
  // they state none, and it is the reference temperature.
  std::optional<double> temperature_c = std::nullopt;
  // Errors of the SLAM system, one standard deviation. Most of each drifts
  // slowly, a small part is independent in every keyframe.
  double slam_rotation_rad = 2e-3;  // roll and pitch; yaw drifts 3 times as far
  double slam_position_m = 5e-3;
  double slam_velocity_mps = 1e-2;
  double slam_accel_bias_mps2 =
      2e-2;  // in addition to the effect of theta_slam
  double slam_gyro_bias_radps = 1e-3;
  double slam_landmark_relative = 0.02;  // of the depth, before triangulation
  Eigen::Vector3d b_a0 = {0.05, -0.08, 0.1};
  Eigen::Vector3d b_g0 = {0.004, -0.003, 0.002};
  // Those of the second IMU, if the device has one.
  Eigen::Vector3d second_b_a0 = {-0.06, 0.04, 0.05};
  Eigen::Vector3d second_b_g0 = {-0.002, 0.005, -0.003};
};

// Sets what docs/recordings.md measures of the errors of tracks in images:
// correlation, common part, tails and outliers. A rig whose pixels err by
// kTrackerSigma_px then has the errors of a real tracker.
inline constexpr double kTrackerSigma_px = 0.026;
void UseTrackerErrors(SimulationOptions* options);

// A landmark with fewer observations in a segment is excluded from it.
inline constexpr int kMinSegmentObservations = 3;

struct SimulatedSession {
  std::vector<MotionSegment> segments;  // as the SLAM system hands them over
  // Truth of the same segments: states, biases and landmarks, noise-free pixels
  // (also for outliers of the segment) and noise-free readings with the true
  // biases. All indices are the same, including those of observations.
  std::vector<MotionSegment> truth;
};

// Simulates a session of a rig whose true calibration is device_true, while the
// SLAM system uses device_slam, each at the temperature of the session: its
// landmarks are triangulated with that calibration, and its biases absorb the
// mean of the resulting errors. Noise, pixel sigma and gravity are those of the
// rig. A second IMU is one of device_true, which the SLAM system does not use.
// Images are exposed later than the time of their keyframe by the true
// time offset of their camera, and the rows of a rolling shutter one after the
// other; if the SLAM system assumes other offsets and line delays, its states
// are those at the middle of its images rather than those of the IMU. A time
// offset drifts from the begin of the session.
//
// Segments of keyframes_per_segment fill the trajectory from its start;
// remaining keyframes at the end that do not fill a segment are dropped. Times
// are relative to the start of the trajectory; keyframes do not coincide with
// IMU samples, and all exposures lie within these. device_true and
// device_slam must have the same cameras, with a rolling shutter or not; rates,
// depths, mean_track_length and keyframes_per_segment must be positive.
SimulatedSession Simulate(const Rig& rig,
                          const Calibration& device_true,
                          const Calibration& device_slam,
                          const Trajectory& trajectory,
                          const std::string& session,
                          const SimulationOptions& options);

// A hand-held device like that of the paper: one FOV camera of 640 x 480, f =
// 255 px, w = 0.92, IMU 200 Hz, with its noise. Its calibration is the truth;
// the caller perturbs it to get a factory calibration (PerturbCalibration).
Rig HandheldRig(const std::string& id);

// Adds a second IMU to a rig of HandheldRig: another package, turned by a
// quarter and a few degrees, some centimetres from the first one, with more
// noise.
void AddSecondImu(Rig* rig);

// Errors of a factory calibration.
struct CalibrationError {
  double focal_relative = 0.02;
  double principal_point_px = 5;
  double distortion_relative = 0.01;
  double camera_rotation_rad = 0.0174533;
  double camera_position_m = 0.01;
  double scale = 0.01;
  double misalignment = 0.01;
  double accel_rotation_rad = 0.0174533;
  // Pose of a second IMU.
  double imu_rotation_rad = 0.0174533;
  double imu_position_m = 0.01;
};

// Returns theta with every block perturbed by exactly the given amount, in a
// direction drawn from the seed: rotations by the angle about a random axis;
// positions and the principal point by the distance in a random direction; each
// scale, misalignment and distortion coefficient up or down by the amount, and
// both focal lengths of a camera together.
Calibration PerturbCalibration(const Calibration& theta,
                               const CalibrationError& error,
                               std::uint64_t seed);

// A change of the device: its first camera is turned, and its focal lengths
// grow.
struct CameraChange {
  double turn_rad = 0;
  double focal_relative = 0;
};

// Returns theta after the change. The axis of the turn is (1, -2, 2) / 3 of the
// body, which is askew to all axes of a device.
Calibration ChangeCamera(const Calibration& theta, const CameraChange& change);

}  // namespace selfcal
