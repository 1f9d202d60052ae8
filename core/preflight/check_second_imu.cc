// The second IMU is a body of its own, which moves rigidly with the first one:
// the checks of an IMU apply to it, with its frame for I and its own clock.
//
// The states say nothing about its biases. They are those by which the readings
// of both IMUs agree on average over a segment, in the median of all segments.
// Wrong readings make absurd ones, or do not fit with them: these are
// identified without any.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "core/model/median.h"
#include "core/model/second_imu.h"
#include "core/preflight/checks.h"

namespace selfcal {
namespace {

const std::string kPrefix = "second IMU: ";
// A larger bias of an accelerometer is gravity in other axes: data sheets state
// up to 80 thousandths of g along an axis (MPU-6050), and a factory calibration
// adds errors of its scale and alignment.
constexpr double kMaxAccelBias_mps2 = 1.5;

// The keyframes of a segment, without readings and observations.
MotionSegment KeyframesOf(const MotionSegment& segment) {
  MotionSegment keyframes;
  keyframes.session_start_ns = segment.session_start_ns;
  keyframes.keyframes = segment.keyframes;
  return keyframes;
}

// The segment of the second IMU as that of a first one.
MotionSegment AsFirst(const Calibration& theta, const MotionSegment& segment) {
  MotionSegment first = KeyframesOf(segment);
  for (KeyframeState& x : first.keyframes) x = StateOfImu(theta, 1, x);
  first.imu = segment.imu1;
  return first;
}

std::vector<MotionSegment> AsFirst(const Calibration& theta,
                                   std::span<const MotionSegment> segments) {
  std::vector<MotionSegment> first;
  for (const MotionSegment& segment : segments) {
    first.push_back(AsFirst(theta, segment));
  }
  return first;
}

// The usable parts of the segments, with keyframes by the clock of the first
// IMU, and the states of the second one.
std::vector<MotionSegment> StartedSegments(
    const Calibration& theta,
    std::span<const MotionSegment> segments,
    double offset_s) {
  const auto shift_ns = static_cast<std::int64_t>(std::llround(offset_s * 1e9));
  std::vector<MotionSegment> started;
  for (const MotionSegment& segment : segments) {
    MotionSegment usable = KeyframesOf(segment);
    std::erase_if(usable.keyframes,
                  [](const KeyframeState& x) { return !IsFinite(x); });
    for (KeyframeState& x : usable.keyframes) x.t_ns += shift_ns;
    usable.imu = UsableSamples(segment.imu);
    usable.imu1 = UsableSamples(segment.imu1);
    if (usable.keyframes.size() < 2 || usable.imu.size() < 2 ||
        usable.imu1.size() < 2) {
      continue;
    }
    StartSecondImu(theta, &usable);
    started.push_back(std::move(usable));
  }
  return started;
}

Eigen::Vector3d MedianBias(const std::vector<MotionSegment>& segments,
                           Eigen::Vector3d KeyframeState::*bias) {
  Eigen::Vector3d median = Eigen::Vector3d::Zero();
  for (int axis = 0; axis < 3 && !segments.empty(); ++axis) {
    std::vector<double> values;
    for (const MotionSegment& segment : segments) {
      values.push_back((segment.keyframes.front().*bias)[axis]);
    }
    median[axis] = UpperMedian(std::move(values));
  }
  return median;
}

void SetBiases(const Eigen::Vector3d& gyro,
               const Eigen::Vector3d& accel,
               std::vector<MotionSegment>* segments) {
  for (MotionSegment& segment : *segments) {
    for (KeyframeState& x : segment.keyframes) {
      x.b_g1 = gyro;
      x.b_a1 = accel;
    }
  }
}

// Axes, units, time offset and gravity, with `theta` for the pose of the second
// IMU.
Diagnosis CheckMotion(const Rig& rig,
                      const Calibration& theta,
                      const std::vector<MotionSegment>& started) {
  Calibration alone;
  alone.imu = *theta.imu1;
  Diagnosis diagnosis;
  const MotionData data = CollectMotion(AsFirst(theta, started));
  const GyroResult gyro = CheckGyro(alone, data, &diagnosis);
  CheckAccelerometer(rig, alone, data, gyro, &diagnosis);
  return diagnosis;
}

// The same with biases, or without any if they do not make everything right.
Diagnosis CheckMotionWithBiases(const Rig& rig,
                                const Calibration& theta,
                                std::span<const MotionSegment> segments,
                                double offset_s) {
  std::vector<MotionSegment> started =
      StartedSegments(theta, segments, offset_s);
  const Eigen::Vector3d gyro = MedianBias(started, &KeyframeState::b_g1);
  const Eigen::Vector3d accel = MedianBias(started, &KeyframeState::b_a1);
  if (accel.norm() < kMaxAccelBias_mps2) {
    SetBiases(gyro, accel, &started);
    Diagnosis diagnosis = CheckMotion(rig, theta, started);
    if (diagnosis.findings.empty() && diagnosis.not_checked.empty()) {
      return diagnosis;
    }
  }
  SetBiases(Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero(), &started);
  return CheckMotion(rig, theta, started);
}

Calibration WithInvertedPose(Calibration theta) {
  SecondImuCalibration& imu = *theta.imu1;
  imu.p_JI = -(imu.q_JI.conjugate() * imu.p_JI);
  imu.q_JI = imu.q_JI.conjugate();
  return theta;
}

// Remedies that concern the second IMU and not the keyframes.
std::string RemedyOf(const Finding& finding) {
  switch (finding.kind) {
    case FindingKind::kImuAxes:
      return "send its readings in the axes that imu1.q_JI is stated for, or "
             "state q_JI for the axes in which they are sent";
    case FindingKind::kTimeOffset:
      return "add " + Figure(-finding.value) +
             " s to imu1.time_offset, and let the rig estimate it";
    case FindingKind::kGyroMismatch:
    case FindingKind::kAccelMismatch:
      return "check that its readings are of the same recording and clock, and "
             "its pose imu1.q_JI, imu1.p_JI: it takes a point from the first "
             "IMU to the second one";
    default:
      return finding.remedy;
  }
}

void Append(Diagnosis part, Diagnosis* all) {
  for (Finding& finding : part.findings) {
    finding.imu = 1;
    finding.cause = kPrefix + finding.cause;
    all->findings.push_back(std::move(finding));
  }
  for (const std::string& one : part.checked) {
    all->checked.push_back(kPrefix + one);
  }
  for (const std::string& one : part.not_checked) {
    all->not_checked.push_back(kPrefix + one);
  }
}

}  // namespace

void CheckSecondImu(const Rig& rig,
                    const Calibration& theta,
                    std::span<const MotionSegment> segments,
                    const GyroResult& first,
                    bool first_is_right,
                    Diagnosis* diagnosis) {
  Diagnosis readings;
  const std::vector<MotionSegment> as_first = AsFirst(theta, segments);
  CheckSampling(as_first, &readings);
  CheckSaturation(as_first, &readings);
  Append(std::move(readings), diagnosis);
  if (!first_is_right) {
    diagnosis->not_checked.push_back(
        kPrefix + "axes, units and gravity: not before the first is correct");
    return;
  }
  Diagnosis stated =
      CheckMotionWithBiases(rig, theta, segments, first.offset_s);
  for (Finding& finding : stated.findings) finding.remedy = RemedyOf(finding);
  if (!stated.findings.empty()) {
    Diagnosis inverted = CheckMotionWithBiases(
        rig, WithInvertedPose(theta), segments, first.offset_s);
    if (inverted.findings.empty() && inverted.not_checked.empty()) {
      inverted.findings.push_back(
          {FindingKind::kExtrinsics,
           "its pose is inverted: its readings fit the motion of the "
           "keyframes if q_JI and p_JI take a point from the second IMU to "
           "the first",
           "invert imu1.q_JI and imu1.p_JI, which take a point from the first "
           "IMU to the second one"});
      stated = std::move(inverted);
    }
  }
  Append(std::move(stated), diagnosis);
}

}  // namespace selfcal
