// The motion segment: N consecutive keyframes of one session with the IMU
// samples between them and the landmarks observed from them, as a SLAM system
// estimated them.
//
// Frames: G is gravity-aligned (z up) and constant during a session, I is the
// body (gyroscope) frame. Times are nanoseconds of one clock during a session.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace selfcal {

// x_k of the paper; tangent order (q_GI 3, p_GI 3, v_GI 3, b_a 3, b_g 3).
struct KeyframeState {
  std::int64_t t_ns = 0;
  Eigen::Quaterniond q_GI = Eigen::Quaterniond::Identity();
  Eigen::Vector3d p_GI = Eigen::Vector3d::Zero();  // [m]
  Eigen::Vector3d v_GI = Eigen::Vector3d::Zero();  // [m/s], in G
  Eigen::Vector3d b_a = Eigen::Vector3d::Zero();   // [m/s^2], in A
  Eigen::Vector3d b_g = Eigen::Vector3d::Zero();   // [rad/s], in I
  // Motion of the second IMU of a rig that has one (second_imu.h), which no
  // SLAM system estimates: velocity of its origin, and its biases.
  Eigen::Vector3d v_GJ = Eigen::Vector3d::Zero();  // [m/s], in G
  Eigen::Vector3d b_a1 = Eigen::Vector3d::Zero();  // [m/s^2], in its A
  Eigen::Vector3d b_g1 = Eigen::Vector3d::Zero();  // [rad/s], in J
};

inline constexpr int kStateTangentSize = 15;
// Kinds of three components each, in this order.
inline constexpr int kStateKinds = kStateTangentSize / 3;
inline constexpr int kStateRotation = 0;
inline constexpr int kStatePosition = 3;
inline constexpr int kStateVelocity = 6;
inline constexpr int kStateAccelBias = 9;
inline constexpr int kStateGyroBias = 12;
// Those of a second IMU (v_GJ 3, b_a1 3, b_g1 3) follow.
inline constexpr int kMotionTangentSize = 9;
inline constexpr int kStateTangentSize2 =
    kStateTangentSize + kMotionTangentSize;

// x_k [+] delta, in the tangent order above: 15 components, or 24.
KeyframeState BoxPlus(const KeyframeState& state,
                      const Eigen::Ref<const Eigen::VectorXd>& delta);

// Raw readings; biases and intrinsics are not corrected.
struct ImuSample {
  std::int64_t t_ns = 0;
  Eigen::Vector3d gyro = Eigen::Vector3d::Zero();   // w~ [rad/s]
  Eigen::Vector3d accel = Eigen::Vector3d::Zero();  // a~ [m/s^2]
};

struct Landmark {
  std::uint64_t id = 0;                           // unique within a session
  Eigen::Vector3d p_G = Eigen::Vector3d::Zero();  // [m]
};

// Keyframe and landmark are indices into the segment, camera is one into the
// rig.
struct Observation {
  std::int32_t keyframe = 0;
  std::int32_t camera = 0;
  std::int32_t landmark = 0;
  Eigen::Vector2d z_px = Eigen::Vector2d::Zero();
};

// Identity of a segment within a rig: equal keys mean the same segment.
struct SegmentKey {
  std::string session;     // 1 to 128 printable ASCII characters
  std::int64_t index = 0;  // counts the segments of the session from 0

  friend bool operator==(const SegmentKey&, const SegmentKey&) = default;
  friend auto operator<=>(const SegmentKey&, const SegmentKey&) = default;
};

// Time by which the samples of a segment should extend beyond its first and its
// last keyframe: a camera may be exposed up to 0.1 s before or after the stamp
// of its image, the last row of an image 35 ms after the first, and the rate at
// an exposure is that of the 15 ms about it.
inline constexpr double kImuPadding_s = 0.15;

struct MotionSegment {
  SegmentKey key;
  // Version of the calibration with which the SLAM system estimated the states.
  // The daemon scores at its active version.
  std::int64_t calibration_version = 1;
  std::vector<KeyframeState> keyframes;  // strictly increasing in time
  // Strictly increasing in time, from at or before the first keyframe to at or
  // after the last, and beyond both by kImuPadding_s where there are samples.
  // If the next segment of the session follows directly, with the next index,
  // the samples extend to its first keyframe, so that neighbours can be joined.
  std::vector<ImuSample> imu;
  // Samples of the second IMU, by the same clock; the same rules hold for them.
  // Empty if the rig has none.
  std::vector<ImuSample> imu1 = {};
  std::vector<Landmark> landmarks;        // ids distinct
  std::vector<Observation> observations;  // any order, at most one for each
                                          // (keyframe, camera, landmark)
  // Temperature of the device in degrees Celsius, if known.
  std::optional<double> temperature_c = std::nullopt;
  // The time at which the session began and its clocks began to drift: the same
  // for all of its segments. Needed by a calibration that has a time drift.
  std::optional<std::int64_t> session_start_ns = std::nullopt;
};

// Time of a keyframe of the segment since its session began [s]; zero if that
// is not known.
double SessionTime(const MotionSegment& segment, const KeyframeState& x);

// Samples from the last at or before the first keyframe to the first at or
// after the last one. Neighbouring segments share at most the sample between
// them, unlike those of `imu`, which overlap: statistics use these. All samples
// if there is no keyframe.
std::span<const ImuSample> SamplesBetweenKeyframes(
    const MotionSegment& segment);

// The same of the second IMU.
std::span<const ImuSample> SecondSamplesBetweenKeyframes(
    const MotionSegment& segment);

// Samples from the last at or before the first keyframe on: those of inertial
// factors. The integration also uses the neighbours of the samples about an
// interval: with those of the padding before the first keyframe, its last
// digits would not be those of a segment without.
std::span<const ImuSample> SamplesFromFirstKeyframe(
    const MotionSegment& segment);
// The same of the second IMU, earlier by the largest time offset that it may
// have.
std::span<const ImuSample> SecondSamplesFromFirstKeyframe(
    const MotionSegment& segment);

// One violated rule: the field, and what to do.
struct Violation {
  std::string field;    // path, e.g. "keyframes[3].q_GI"
  std::string message;  // e.g. "norm is 0.93; send a unit quaternion"
};

// Limits of a valid segment. The counts bound the memory that one message can
// claim.
struct SegmentLimits {
  int min_keyframes = 2;
  int max_keyframes = 2000;
  int max_imu_samples = 2'000'000;
  int max_landmarks = 200'000;
  int max_observations = 2'000'000;
  double quaternion_norm_tolerance = 1e-6;
  double max_imu_gap_s = 0.5;      // between neighbouring samples
  double max_keyframe_gap_s = 10;  // between neighbouring keyframes
  double max_position_m = 1e6;     // keyframes and landmarks, from the origin
  double max_speed_mps = 1e3;
  double max_gyro_radps = 1e3;  // readings and biases
  double max_accel_mps2 = 1e4;
  double pixel_margin_px = 1;  // outside the image
  double min_temperature_c = -100;
  double max_temperature_c = 200;
  double max_session_s = 30 * 86400.0;  // from its begin to a keyframe
  double max_clock_offset_s = 0.5;      // of a camera whose clock drifts, then
  int max_violations = 100;  // the list is truncated here; one more entry,
                             // without a field, reports that
};

struct Calibration;  // core/model/calibration.h

// Returns every violation of the rules above, in the order of the fields. An
// empty list means that all other modules can use the segment without further
// checks. `theta` provides the number of cameras and the size of their images.
// The function checks finiteness, times, unit quaternions, indices, duplicates,
// coverage by IMU samples, and counts; a list with too many elements is
// rejected without inspection. Samples may extend at most max_keyframe_gap_s
// beyond the last keyframe, and times lie within 4e18 ns of zero, so that their
// differences do not overflow.
std::vector<Violation> Validate(const MotionSegment& segment,
                                const Calibration& theta,
                                const SegmentLimits& limits = {});

}  // namespace selfcal
