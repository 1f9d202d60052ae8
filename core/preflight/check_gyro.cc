// Compares rates with the rotations between keyframes: Wahba's problem over the
// 48 signed permutations of axes, with a scale for the unit and a time offset.
// Each candidate is then integrated exactly.
#include <array>
#include <cmath>
#include <numbers>
#include <string>

#include "core/preflight/checks.h"
#include "core/preflight/signed_permutation.h"
#include "core/preflight/time_offset.h"
#include "core/preflight/turns.h"

namespace selfcal {
namespace {

// Residual shares of the rotations: one above kUnexplainedRate needs an
// explanation, whose residual is at most a third of that without it.
constexpr double kUnexplainedRate = 0.5;
constexpr double kRateGain = 3;

constexpr double kOffsetSigmas = 6;

struct RateUnit {
  double to_radps;
  const char* name;
};
constexpr double kDegree = std::numbers::pi / 180;
constexpr std::array<RateUnit, 4> kRateUnits = {
    {{1, "rad/s"},
     {kDegree, "deg/s"},
     {1 / kDegree, "rad/s times pi/180"},
     {1e-3 * kDegree, "mdeg/s"}}};

const RateUnit& NearestUnit(double speed_ratio) {
  const RateUnit* nearest = kRateUnits.data();
  const auto distance = [&](const RateUnit& unit) {
    return std::abs(std::log(speed_ratio * unit.to_radps));
  };
  for (const RateUnit& unit : kRateUnits) {
    if (distance(unit) < distance(*nearest)) nearest = &unit;
  }
  return *nearest;
}

// Reasons why keyframes may have other axes than the IMU.
enum class Turned { kImu, kCameraPoses, kInvertedExtrinsics };

// R_BI if keyframes are poses of a frame B.
Eigen::Matrix3d BodyToPoseRotation(Turned turned, const Eigen::Matrix3d& R_CI) {
  if (turned == Turned::kCameraPoses) return R_CI;
  return (R_CI * R_CI).transpose();
}

// A hypothesis with its best offset.
struct Candidate {
  Turned turned = Turned::kImu;
  Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();
  Eigen::Matrix3d R_BI = Eigen::Matrix3d::Identity();
  OffsetFit offset;
  RateFit without;  // with zero offset
  RateFit with;
};

class GyroCheck {
 public:
  GyroCheck(const Calibration& theta,
            const MotionData& data,
            Diagnosis* diagnosis)
      : theta_(theta), data_(data), diagnosis_(diagnosis) {}

  GyroResult Run() {
    if (!Turns(data_)) {
      diagnosis_->not_checked.push_back(
          "gyroscope axes, units and time offset: the device hardly turns (" +
          Figure(MeanSpeed(data_)) + " rad/s over " +
          std::to_string(data_.intervals.size()) + " intervals of keyframes)");
      return {};
    }
    const double ratio = SpeedRatio(data_);
    unit_ = ratio > 0 ? NearestUnit(ratio) : kRateUnits[0];
    const CoarseAlignment coarse = AlignRates(data_, unit_.to_radps);
    Candidate best = Fit(Eigen::Matrix3d::Identity(), coarse.straight_s);
    const double straight = best.with.share();
    if (straight > kExplained) best = BestAxes(coarse, best);
    if (best.with.share() > kExplained) {
      if (best.with.share() > kUnexplainedRate)
        ReportMismatch(best);
      else
        ReportUndetermined(best);
      return {};
    }
    ReportUnit(ratio);
    ReportOffset(best);
    diagnosis_->checked.push_back("gyroscope axes, units and time offset: " +
                                  std::to_string(best.with.intervals) +
                                  " turns of " + Figure(best.with.turn_rad) +
                                  " rad, " + Figure(100 * best.with.share()) +
                                  " % of them left; offset " +
                                  Figure(1e3 * best.offset.offset_s) + " ms");
    GyroResult result;
    result.offset_s = best.offset.offset_s;
    result.R_BI = best.R_BI;
    if (best.turned != Turned::kImu) {
      ReportExtrinsics(best, straight);
    } else if (!best.axes.isIdentity()) {
      result.axes = best.axes;
      ReportAxes(best, straight);
    }
    return result;
  }

 private:
  Candidate Fit(const Eigen::Matrix3d& axes, double offset_s) const {
    return Fit(data_, axes, offset_s);
  }

  Candidate Fit(const MotionData& data,
                const Eigen::Matrix3d& axes,
                double offset_s) const {
    const Eigen::Matrix3d M = unit_.to_radps * axes;
    Candidate c;
    c.axes = axes;
    c.without = FitRates(data, theta_.imu, {M, 0});
    c.offset = RefineOffset(data, theta_.imu, {M, offset_s});
    c.with = FitRates(data, theta_.imu, {M, c.offset.offset_s});
    if (c.with.intervals >= kMinIntervals &&
        c.with.share() <= c.without.share()) {
      return c;
    }
    c.offset = {0, c.offset.sigma_s};
    c.with = c.without;
    return c;
  }

  // The best axes if they explain what `straight` does not. Of those that
  // explain about equally well, the ones with the fewest changes.
  Candidate BestAxes(const CoarseAlignment& coarse,
                     const Candidate& straight) const {
    constexpr double kAsGood = 0.7;
    Candidate best = straight;
    for (const Eigen::Matrix3d& axes : coarse.axes) {
      const Candidate candidate = Fit(axes, coarse.turned_s);
      if (candidate.with.share() < kAsGood * best.with.share()) {
        best = candidate;
      }
    }
    TryExtrinsics(coarse, &best);
    const bool gains = kRateGain * best.with.share() < straight.with.share();
    return gains ? best : straight;
  }

  // Tries keyframes that are poses of a camera, and keyframes computed from
  // these with inverted extrinsics, R_GC R_IC instead of R_GC R_CI. Cameras are
  // never mounted exactly along the axes of the IMU: if one of these fits no
  // worse than any permutation of axes, it is the reason.
  void TryExtrinsics(const CoarseAlignment& coarse, Candidate* best) const {
    for (const CameraCalibration& camera : theta_.cameras) {
      const Eigen::Matrix3d R_CI = camera.q_CI.toRotationMatrix();
      for (const Turned turned :
           {Turned::kCameraPoses, Turned::kInvertedExtrinsics}) {
        const Eigen::Matrix3d R_BI = BodyToPoseRotation(turned, R_CI);
        Candidate candidate = Fit(
            InBody(data_, R_BI), Eigen::Matrix3d::Identity(), coarse.turned_s);
        candidate.R_BI = R_BI;
        candidate.turned = turned;
        if (candidate.with.share() < best->with.share()) *best = candidate;
      }
    }
  }

  void ReportUnit(double ratio) {
    if (unit_.to_radps == 1) return;
    diagnosis_->findings.push_back(
        {FindingKind::kGyroUnits,
         std::string("the rates of the gyroscope are in ") + unit_.name +
             ": they are " + Figure(ratio) +
             " times those of the keyframes' rotation",
         "send rad/s: multiply the rates by " + Figure(unit_.to_radps),
         ratio});
  }

  void ReportAxes(const Candidate& best, double straight) {
    const std::string axes = AxesText(best.axes);
    diagnosis_->findings.push_back(
        {FindingKind::kImuAxes,
         "the axes of the gyroscope are not those of the keyframes' body "
         "frame: its rates fit their rotation as " +
             axes + " (" + Figure(100 * best.with.share()) +
             " % of the turns left, as sent " + Figure(100 * straight) + " %)",
         "send the rates as " + axes +
             " of what is sent now, or state the "
             "poses q_gi and extrinsics q_ci in the frame of the gyroscope",
         straight / best.with.share()});
  }

  void ReportExtrinsics(const Candidate& best, double straight) {
    const bool poses = best.turned == Turned::kCameraPoses;
    diagnosis_->findings.push_back(
        {FindingKind::kExtrinsics,
         std::string(poses ? "the keyframes are poses of the camera"
                           : "the keyframes were made with inverted "
                             "extrinsics") +
             ": the rates of the gyroscope fit their rotation when turned by " +
             (poses ? "R_CI" : "R_CI transposed, twice") + " (" +
             Figure(100 * best.with.share()) +
             " % of the turns left, as sent " + Figure(100 * straight) + " %)",
         poses ? "send the poses of the body: T_GI = T_GC T_CI"
               : "invert q_ci and p_ci, which take a point from the body to "
                 "the camera frame, and make the poses with them: T_GI = T_GC "
                 "T_CI",
         straight / best.with.share()});
  }

  void ReportOffset(const Candidate& best) {
    const OffsetFit& fit = best.offset;
    const double tolerance_s =
        std::max(kLeastTimeOffset_s, kOffsetSigmas * fit.sigma_s);
    if (IsStatedOffset(theta_, data_.session_s, fit.offset_s, tolerance_s)) {
      return;
    }
    const std::string ms = Figure(1e3 * std::abs(fit.offset_s)) + " ms";
    const bool late = fit.offset_s > 0;
    diagnosis_->findings.push_back(
        {FindingKind::kTimeOffset,
         "the stamps of the keyframes are " + ms +
             (late ? " earlier" : " later") +
             " than the clock of the IMU says: the gyroscope's rotation fits "
             "theirs best there (" +
             Figure(100 * best.with.share()) +
             " % of the turns left, as sent " +
             Figure(100 * best.without.share()) + " %; sigma " +
             Figure(1e3 * fit.sigma_s) + " ms)",
         std::string(late ? "add " : "subtract ") + ms +
             (late ? " to" : " from") +
             " the stamps of the keyframes; or add " + Figure(fit.offset_s) +
             " to time_offset_s of the cameras, and let the rig estimate it",
         fit.offset_s});
  }

  void ReportMismatch(const Candidate& best) {
    diagnosis_->findings.push_back(
        {FindingKind::kGyroMismatch,
         "the rates of the gyroscope do not fit the rotation of the "
         "keyframes, whatever the axes, the unit and an offset of up to 0.5 "
         "s: " +
             Figure(100 * best.with.share()) + " % of the turns are left",
         "check that samples and keyframes are of the same recording and "
         "clock, and that q_gi takes the body frame to G (not the inverse)",
         best.with.share()});
  }

  void ReportUndetermined(const Candidate& best) {
    diagnosis_->not_checked.push_back(
        "gyroscope axes, units and time offset: rates and keyframes agree "
        "too loosely to tell (" +
        Figure(100 * best.with.share()) + " % of the turns left)");
  }

  const Calibration& theta_;
  const MotionData& data_;
  Diagnosis* diagnosis_;
  RateUnit unit_ = kRateUnits[0];
};

}  // namespace

GyroResult CheckGyro(const Calibration& theta,
                     const MotionData& data,
                     Diagnosis* diagnosis) {
  return GyroCheck(theta, data, diagnosis).Run();
}

}  // namespace selfcal
