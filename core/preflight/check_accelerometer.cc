// Compares accelerations with the change of velocity between keyframes, minus
// gravity: over units, the 48 signed permutations of axes, and hypotheses about
// gravity in the readings and in G.
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "core/preflight/checks.h"
#include "core/preflight/forces.h"
#include "core/preflight/signed_permutation.h"

namespace selfcal {
namespace {

constexpr int kMinIntervals = 10;
// Errors as fractions of gravity: the error of an explanation is less than
// kExplainedForce and at most a third of the error without it, which has to
// exceed kNoticed; an error above kUnexplainedForce is reported even without an
// explanation.
constexpr double kExplainedForce = 0.15;
constexpr double kNoticed = 0.1;
constexpr double kUnexplainedForce = 0.3;
constexpr double kForceGain = 3;
// Range of the norm of correct readings, as a fraction of gravity: also in
// vigorous motion, and with gravity removed.
constexpr double kRightLow = 0.6;
constexpr double kRightHigh = 1.7;

struct ForceUnit {
  double to_mps2;
  const char* name;
};
constexpr double kStandardGravity = 9.80665;
constexpr std::array<ForceUnit, 3> kForceUnits = {
    {{kStandardGravity, "g"},
     {1e-3 * kStandardGravity, "thousandths of g"},
     {1 / kStandardGravity, "m/s^2 times 9.81"}}};

std::string Vector(const Eigen::Vector3d& v) {
  return "(" + Figure(v.x()) + ", " + Figure(v.y()) + ", " + Figure(v.z()) +
         ")";
}

class AccelerometerCheck {
 public:
  AccelerometerCheck(double gravity,
                     const std::vector<ForceInterval>& forces,
                     Diagnosis* diagnosis)
      : up_(0, 0, gravity),
        gravity_(gravity),
        forces_(forces),
        diagnosis_(diagnosis) {}

  void Run(double median, const GyroResult& gyro) {
    if (!FindUnit(median / gravity_)) return;
    const Eigen::Matrix3d identity = Eigen::Matrix3d::Identity();
    const double straight = Error(identity, up_);
    diagnosis_->checked.push_back("accelerometer axes, units and gravity: " +
                                  std::to_string(forces_.size()) +
                                  " intervals, " + Figure(100 * straight) +
                                  " % of gravity left");
    const Eigen::Matrix3d axes = BestAxes(gyro);
    const Eigen::Vector3d rest = MeanRest();
    const double turned = Error(axes, up_);
    const double tilted = Error(identity, rest);
    const double least = std::min(turned, tilted);
    if (straight < kNoticed) return;
    if (least > kExplainedForce || kForceGain * least > straight) {
      if (straight > kUnexplainedForce) ReportMismatch(straight);
      return;
    }
    // A permutation that fits the rates also applies to the accelerations.
    if (gyro.axes && axes == *gyro.axes) {
      return ReportAxes(axes, straight, turned);
    }
    if (tilted <= turned && IsMissing(rest)) return ReportMissing();
    // Either the sensor or G is upside down: gravity has the wrong sign.
    if (axes == -identity || IsDown(rest)) return ReportSign(rest, straight);
    if (turned <= tilted) return ReportAxes(axes, straight, turned);
    ReportTilt(rest, straight, tilted);
  }

 private:
  // Residual as a fraction of gravity, if readings at rest have the mean `rest`
  // in G.
  double Error(const Eigen::Matrix3d& axes, const Eigen::Vector3d& rest) const {
    std::vector<double> errors;
    for (const ForceInterval& f : forces_) {
      errors.push_back((f.Force(unit_ * axes) - f.acceleration - rest).norm());
    }
    return TrimmedRms(&errors) / gravity_;
  }

  // Mean of the received forces minus the acceleration: gravity in the data.
  Eigen::Vector3d MeanRest() const {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (const ForceInterval& f : forces_) {
      sum += f.Force(unit_ * Eigen::Matrix3d::Identity()) - f.acceleration;
    }
    return sum / static_cast<double>(forces_.size());
  }

  bool IsMissing(const Eigen::Vector3d& rest) const {
    return rest.norm() < kExplainedForce / 2 * gravity_;
  }

  bool IsDown(const Eigen::Vector3d& rest) const {
    return (rest + up_).norm() < kExplainedForce * gravity_;
  }

  // The axes of the gyroscope if they fit about as well as any; otherwise, of
  // those that fit about equally well, the ones with the fewest changes.
  Eigen::Matrix3d BestAxes(const GyroResult& gyro) const {
    constexpr double kAsGood = 0.7;
    Eigen::Matrix3d best = Eigen::Matrix3d::Identity();
    double least = Error(best, up_);
    for (const Eigen::Matrix3d& axes : SignedPermutations()) {
      const double error = Error(axes, up_);
      if (error >= kAsGood * least) continue;
      least = error;
      best = axes;
    }
    if (gyro.axes && kAsGood * Error(*gyro.axes, up_) < least) {
      return *gyro.axes;
    }
    return best;
  }

  // Sets the unit. Returns false, after reporting it, if no known unit fits.
  bool FindUnit(double ratio) {
    if (ratio > kRightLow && ratio < kRightHigh) return true;
    if (IsMissing(MeanRest()) && MissingExplains()) {
      ReportMissing();
      return false;
    }
    for (const ForceUnit& unit : kForceUnits) {
      const double right = ratio * unit.to_mps2;
      if (right < kRightLow || right > kRightHigh) continue;
      unit_ = unit.to_mps2;
      diagnosis_->findings.push_back(
          {FindingKind::kAccelUnits,
           std::string("the accelerations are in ") + unit.name +
               ": their median length is " + Figure(ratio) +
               " times gravity's " + Figure(gravity_) + " m/s^2",
           "send m/s^2: multiply them by " + Figure(unit.to_mps2),
           ratio});
      return true;
    }
    diagnosis_->findings.push_back(
        {FindingKind::kAccelMismatch,
         "the accelerations have a median length of " + Figure(ratio) +
             " times gravity's " + Figure(gravity_) +
             " m/s^2, which no known unit explains",
         "check the unit of the readings and gravity_mps2 of the rig",
         ratio});
    return false;
  }

  // Returns true if readings are the acceleration without gravity. A small
  // residual at zero gravity proves nothing if the readings may be in units of
  // g: the residual with those must be larger.
  bool MissingExplains() {
    const double removed =
        Error(Eigen::Matrix3d::Identity(), Eigen::Vector3d::Zero());
    double in_unit = 1;
    for (const ForceUnit& unit : kForceUnits) {
      unit_ = unit.to_mps2;
      for (const Eigen::Matrix3d& axes : SignedPermutations()) {
        in_unit = std::min(in_unit, Error(axes, up_));
      }
    }
    unit_ = 1;
    return removed < kExplainedForce && removed < in_unit;
  }

  void ReportMissing() {
    diagnosis_->findings.push_back(
        {FindingKind::kGravity,
         "gravity is missing from the accelerations: their mean in G is " +
             Vector(MeanRest()) + " m/s^2 instead of " + Vector(up_),
         "send what the accelerometer reads (specific force), not the linear "
         "acceleration that a driver makes of it",
         MeanRest().norm()});
  }

  void ReportSign(const Eigen::Vector3d& rest, double straight) {
    diagnosis_->findings.push_back(
        {FindingKind::kGravity,
         "gravity has the wrong sign: the mean of the accelerations in G is " +
             Vector(rest) + " m/s^2 instead of " + Vector(up_),
         "send the specific force, which at rest points up; if the readings do "
         "so, turn G so that its z axis points up",
         straight});
  }

  void ReportAxes(const Eigen::Matrix3d& axes, double straight, double turned) {
    diagnosis_->findings.push_back(
        {FindingKind::kImuAxes,
         "the axes of the accelerometer are not those of the keyframes' body "
         "frame: its readings fit their motion as " +
             AxesText(axes) + " (" + Figure(100 * turned) +
             " % of gravity left, as sent " + Figure(100 * straight) + " %)",
         "send the accelerations as " + AxesText(axes) +
             " of what is sent now, or state the poses q_gi and extrinsics "
             "q_ci in the frame of the sensor",
         straight / turned});
  }

  void ReportTilt(const Eigen::Vector3d& rest, double straight, double tilted) {
    const double angle = std::acos(rest.normalized().z());
    diagnosis_->findings.push_back(
        {FindingKind::kGravity,
         "G is not level: gravity is " +
             Figure(angle * 180 / std::numbers::pi) +
             " degrees from its z axis, the accelerations at rest are " +
             Vector(rest) + " m/s^2 in it instead of " + Vector(up_) + " (" +
             Figure(100 * tilted) + " % of gravity left, as sent " +
             Figure(100 * straight) + " %)",
         "turn poses, velocities and landmarks into a frame whose z axis "
         "points up; if it does, the poses q_gi are not those of the body",
         angle});
  }

  void ReportMismatch(double straight) {
    diagnosis_->findings.push_back(
        {FindingKind::kAccelMismatch,
         "the accelerations do not fit the motion of the keyframes, whatever "
         "the axes and the direction of gravity: " +
             Figure(100 * straight) + " % of gravity are left",
         "check that samples and keyframes are of the same recording and "
         "clock, and that v_gi is in m/s and in G",
         straight});
  }

  const Eigen::Vector3d up_;
  const double gravity_;
  const std::vector<ForceInterval>& forces_;
  Diagnosis* diagnosis_;
  double unit_ = 1;
};

}  // namespace

void CheckAccelerometer(const Rig& rig,
                        const Calibration& theta,
                        const MotionData& data,
                        const GyroResult& gyro,
                        Diagnosis* diagnosis) {
  const auto forces =
      CollectForces(InBody(data, gyro.R_BI), theta.imu, gyro.offset_s);
  if (forces.size() < kMinIntervals) {
    diagnosis->not_checked.push_back(
        "accelerometer axes, units and gravity: only " +
        std::to_string(forces.size()) +
        " intervals of keyframes with samples (at least " +
        std::to_string(kMinIntervals) + ")");
    return;
  }
  AccelerometerCheck(rig.gravity_mps2, forces, diagnosis)
      .Run(MedianAcceleration(data), gyro);
}

}  // namespace selfcal
