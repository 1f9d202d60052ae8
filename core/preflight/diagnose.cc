#include "core/preflight/diagnose.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "core/model/median.h"
#include "core/model/temperature.h"
#include "core/preflight/checks.h"
#include "core/preflight/late_states.h"
#include "core/preflight/motion_data.h"

namespace selfcal {
namespace {

// True if the first IMU predicts the motion in spite of what was found.
bool LeavesMotion(const Diagnosis& diagnosis) {
  return std::all_of(diagnosis.findings.begin(),
                     diagnosis.findings.end(),
                     [](const Finding& finding) {
                       switch (finding.kind) {
                         case FindingKind::kTimeOffset:
                         case FindingKind::kClockDrift:
                         case FindingKind::kDroppedSamples:
                         case FindingKind::kRepeatedSamples:
                         case FindingKind::kSaturation:
                           return true;
                         default:
                           return finding.imu == 1;
                       }
                     });
}

// The median of the segments.
double UsualTemperature(const Calibration& theta,
                        std::span<const MotionSegment> segments) {
  std::vector<double> all_c;
  for (const MotionSegment& segment : segments) {
    all_c.push_back(TemperatureOf(theta, segment));
  }
  return all_c.empty() ? theta.reference_temperature_c
                       : UpperMedian(std::move(all_c));
}

}  // namespace

std::string_view FindingName(FindingKind kind) {
  switch (kind) {
    case FindingKind::kImuAxes:
      return "imu-axes";
    case FindingKind::kGyroUnits:
      return "gyro-units";
    case FindingKind::kAccelUnits:
      return "accel-units";
    case FindingKind::kGravity:
      return "gravity";
    case FindingKind::kTimeOffset:
      return "time-offset";
    case FindingKind::kClockDrift:
      return "clock-drift";
    case FindingKind::kDroppedSamples:
      return "dropped-samples";
    case FindingKind::kRepeatedSamples:
      return "repeated-samples";
    case FindingKind::kSaturation:
      return "saturation";
    case FindingKind::kExtrinsics:
      return "extrinsics";
    case FindingKind::kFocalLength:
      return "focal-length";
    case FindingKind::kLandmarkFrame:
      return "landmark-frame";
    case FindingKind::kRollingShutter:
      return "rolling-shutter";
    case FindingKind::kGyroMismatch:
      return "gyro-mismatch";
    case FindingKind::kAccelMismatch:
      return "accel-mismatch";
    case FindingKind::kReprojectionMismatch:
      return "reprojection-mismatch";
  }
  return "";
}

Diagnosis Diagnose(const Rig& rig,
                   const Calibration& of_device,
                   std::span<const MotionSegment> segments) {
  Diagnosis diagnosis;
  const Calibration theta =
      AtTemperature(of_device, UsualTemperature(of_device, segments));
  CheckSampling(segments, &diagnosis);
  CheckSaturation(segments, &diagnosis);
  const MotionData data = CollectMotion(segments);
  diagnosis.session_s = data.session_s;
  const GyroResult gyro = CheckGyro(theta, data, &diagnosis);
  CheckClocks(theta, segments, &diagnosis);
  CheckAccelerometer(rig, theta, data, gyro, &diagnosis);
  if (theta.imu1) {
    CheckSecondImu(
        rig, theta, segments, gyro, LeavesMotion(diagnosis), &diagnosis);
  }
  const auto late_s = FindLateStates(rig, theta, segments);
  CheckReprojection(rig, theta, segments, late_s, &diagnosis);
  if (LeavesMotion(diagnosis)) {
    CheckShutter(rig, theta, segments, late_s, &diagnosis);
  } else {
    diagnosis.not_checked.push_back("shutter: not before the above is correct");
  }
  return diagnosis;
}

}  // namespace selfcal
