#include "core/factor/keyframe_motion.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <optional>

#include "core/model/imu_model.h"
#include "core/model/so3.h"

namespace selfcal {
namespace {

using Eigen::Vector3d;

// Rates are averaged over this time on either side, and at least this many
// samples.
constexpr double kHalfWindow_s = 0.015;
constexpr std::ptrdiff_t kMinSamples = 4;
// The line is extrapolated no further than this beyond the samples.
constexpr double kReach_s = 0.03;
// A rate is shrunk by this multiple of its noise, in squares, over three axes:
// noise alone is larger 3 times in 100.
constexpr double kNoiseSquares = 3 * 3;
// The polynomials of a readout are fitted over at least this time on either
// side of the middle row.
constexpr double kLeastHalfReadout_s = 0.005;

// Corrected readings about a keyframe. Times [s] are relative to the keyframe.
class Readings {
 public:
  Readings(std::span<const ImuSample> samples,
           const KeyframeState& x,
           const ImuCalibration& imu)
      : samples_(samples), x_(x), imu_(CorrectionOf(imu)) {}

  // The force of a reading, given the derivative of its rate.
  Vector3d ForceAtOrigin(const CorrectedReading<double>& reading,
                         const Vector3d& dw) const {
    if (imu_.position_size == 0) return reading.f;
    return imu_.ForceAtOrigin(reading.f,
                              ForceByPosition<double>(reading.w, dw));
  }

  using Reading = CorrectedReading<double>;

  // Time of the next sample from one time towards another, or that one if it is
  // nearer.
  double Next(double from_s, double to_s) const {
    const bool forwards = to_s > from_s;
    const auto at = forwards ? After(from_s) : Before(from_s);
    if (at < 0 || at >= std::ssize(samples_)) return to_s;
    return forwards ? std::min(Time(at), to_s) : std::max(Time(at), to_s);
  }

  Reading Interpolate(double t_s) const {
    const std::ptrdiff_t after = After(t_s);
    if (after == 0 || after == std::ssize(samples_)) return Smooth(t_s);
    const double begin_s = Time(after - 1);
    const double part = (t_s - begin_s) / (Time(after) - begin_s);
    const ImuSample& a = samples_[after - 1];
    const ImuSample& b = samples_[after];
    return Correct(a.gyro + part * (b.gyro - a.gyro),
                   a.accel + part * (b.accel - a.accel));
  }

  // Evaluates the line through the samples about the time, or the nearest ones.
  Reading Smooth(double t_s) const {
    double variance_Hz;
    return Smooth(t_s, &variance_Hz);
  }

  // The rate of Smooth, shrunk by white noise, and to what share of it.
  Vector3d Rate(double t_s, double noise_density, double* share) const {
    double variance_Hz;
    const Vector3d w_I = Smooth(t_s, &variance_Hz).w;
    const double noise =
        kNoiseSquares * noise_density * noise_density * variance_Hz;
    *share = std::max(0.0, 1 - noise / w_I.squaredNorm());
    return *share * w_I;
  }

 private:
  // *variance_Hz is the variance of the result for a noise density of one.
  Reading Smooth(double t_s, double* variance_Hz) const {
    const double first_s = Time(0);
    const double last_s = Time(std::ssize(samples_) - 1);
    const double center_s = std::clamp(t_s, first_s, last_s);
    std::ptrdiff_t begin = Before(center_s - kHalfWindow_s) + 1;
    std::ptrdiff_t end = After(center_s + kHalfWindow_s);
    while (end - begin < kMinSamples && end - begin < std::ssize(samples_)) {
      const bool earlier =
          end == std::ssize(samples_) ||
          (begin > 0 && center_s - Time(begin - 1) < Time(end) - center_s);
      earlier ? --begin : ++end;
    }
    double mean_s = 0;
    Vector3d gyro = Vector3d::Zero(), accel = Vector3d::Zero();
    const auto count = static_cast<double>(end - begin);
    for (std::ptrdiff_t i = begin; i < end; ++i) {
      mean_s += Time(i) / count;
      gyro += samples_[i].gyro / count;
      accel += samples_[i].accel / count;
    }
    double square = 0;
    Vector3d gyro_slope = Vector3d::Zero(), accel_slope = Vector3d::Zero();
    for (std::ptrdiff_t i = begin; i < end; ++i) {
      const double s = Time(i) - mean_s;
      square += s * s;
      gyro_slope += s * samples_[i].gyro;
      accel_slope += s * samples_[i].accel;
    }
    const double at_s = std::clamp(t_s, first_s - kReach_s, last_s + kReach_s);
    // The condition is on the number of samples: with fused multiply-add, the
    // sum of squares of a single one is a rounding error.
    const double along = end - begin > 1 ? (at_s - mean_s) / square : 0;
    const double rate_Hz =
        end - begin > 1 ? (count - 1) / (Time(end - 1) - Time(begin)) : 0;
    *variance_Hz = rate_Hz * (1 / count + along * along * square);
    return Correct(gyro + along * gyro_slope, accel + along * accel_slope);
  }

  double Time(std::ptrdiff_t i) const {
    return static_cast<double>(samples_[i].t_ns - x_.t_ns) * 1e-9;
  }
  // First sample later than the time.
  std::ptrdiff_t After(double t_s) const {
    const auto later = [&](double t, const ImuSample& sample) {
      return t < static_cast<double>(sample.t_ns - x_.t_ns) * 1e-9;
    };
    return std::upper_bound(samples_.begin(), samples_.end(), t_s, later) -
           samples_.begin();
  }
  // Last sample earlier than the time.
  std::ptrdiff_t Before(double t_s) const {
    const auto earlier = [&](const ImuSample& sample, double t) {
      return static_cast<double>(sample.t_ns - x_.t_ns) * 1e-9 < t;
    };
    return std::lower_bound(samples_.begin(), samples_.end(), t_s, earlier) -
           samples_.begin() - 1;
  }
  Reading Correct(const Vector3d& gyro, const Vector3d& accel) const {
    return imu_.Correct(gyro, accel, x_.b_g, x_.b_a);
  }

  std::span<const ImuSample> samples_;
  const KeyframeState& x_;
  CoupledImuModel<double> imu_;
};

// Integrates the readings about a keyframe. Times are relative to it, gravity
// and the motion are in I at its time.
class MotionIntegral {
 public:
  MotionIntegral(const Readings& readings, const Vector3d& g_I)
      : readings_(readings), g_I_(g_I) {}

  // Continues a motion that is measured up to motion->dt_s.
  void Continue(double to_s, KeyframeMotion* motion) const {
    if (motion->dt_s == to_s) return;
    Readings::Reading here = readings_.Interpolate(motion->dt_s);
    while (motion->dt_s != to_s) {
      const double next_s = readings_.Next(motion->dt_s, to_s);
      const double h = next_s - motion->dt_s;
      const Readings::Reading there = readings_.Interpolate(next_s);
      const Vector3d dw = (there.w - here.w) / h;
      const auto acceleration =
          [&](const Readings::Reading& reading) -> Vector3d {
        return motion->turn * readings_.ForceAtOrigin(reading, dw) + g_I_;
      };
      const Vector3d a_I = acceleration(here);
      motion->turn = motion->turn * Exp(0.5 * h * (here.w + there.w));
      const Vector3d next_a_I = acceleration(there);
      motion->shift_I += h * motion->v_I + h * h / 6 * (2 * a_I + next_a_I);
      motion->v_I += h / 2 * (a_I + next_a_I);
      motion->dt_s = next_s;
      here = there;
    }
  }

 private:
  const Readings& readings_;
  const Vector3d& g_I_;
};

// Coefficients of s, s^2 and s^3 of the cubic polynomial with this slope at
// zero and these values at -h and h.
Eigen::Matrix3d Cubic(const Vector3d& slope,
                      const Vector3d& before,
                      const Vector3d& after,
                      double h) {
  Eigen::Matrix3d coefficients;
  coefficients << slope, (before + after) / (2 * h * h),
      ((after - before) / (2 * h) - slope) / (h * h);
  return coefficients;
}

// The motion on either side of that to the middle row.
ReadoutMotion MeasureReadout(const Readings& readings,
                             const MotionIntegral& integral,
                             const KeyframeMotion& middle,
                             double rate_share,
                             double half_s) {
  KeyframeMotion before = middle, after = middle;
  integral.Continue(middle.dt_s - half_s, &before);
  integral.Continue(middle.dt_s + half_s, &after);
  const Eigen::Quaterniond back = middle.turn.conjugate();
  ReadoutMotion readout;
  readout.turn = Cubic(readings.Interpolate(middle.dt_s).w,
                       Log(back * before.turn),
                       Log(back * after.turn),
                       half_s);
  readout.shift = Cubic(back * middle.v_I,
                        back * (before.shift_I - middle.shift_I),
                        back * (after.shift_I - middle.shift_I),
                        half_s);
  readout.rate_share = rate_share;
  return readout;
}

KeyframeMotion Measure(std::span<const ImuSample> samples,
                       const KeyframeState& x,
                       const ImuCalibration& imu,
                       const ImuNoise& noise,
                       double gravity_mps2,
                       double dt_s,
                       std::optional<double> half_readout_s) {
  const Readings readings(samples, x, imu);
  const Eigen::Matrix3d R_IG = x.q_GI.toRotationMatrix().transpose();
  const Vector3d g_I = R_IG * Vector3d(0, 0, -gravity_mps2);
  const MotionIntegral integral(readings, g_I);
  KeyframeMotion motion;
  motion.v_I = R_IG * x.v_GI;
  double rate_share = 1;
  motion.w_I = readings.Rate(dt_s, noise.gyro_noise_density, &rate_share);
  integral.Continue(dt_s, &motion);
  if (half_readout_s) {
    motion.readout =
        MeasureReadout(readings, integral, motion, rate_share, *half_readout_s);
  }
  return motion;
}

// A pose moved by a motion: derivatives with respect to the rotation.
ExposurePose Moved(const Eigen::Quaterniond& q_GI,
                   const Vector3d& p_GI,
                   const Eigen::Quaterniond& turn,
                   const Vector3d& shift_I) {
  const Eigen::Matrix3d R_GI = q_GI.toRotationMatrix();
  ExposurePose pose;
  pose.q_GI = q_GI * turn;
  pose.p_GI = p_GI + R_GI * shift_I;
  pose.by_rotation << turn.toRotationMatrix().transpose(),
      -R_GI * Skew(shift_I);
  return pose;
}

}  // namespace

KeyframeContext ContextOf(const MotionSegment& segment, std::size_t keyframe) {
  return {segment.imu, SessionTime(segment, segment.keyframes[keyframe])};
}

KeyframeMotion MeasureMotion(std::span<const ImuSample> samples,
                             const KeyframeState& x,
                             const ImuCalibration& imu,
                             const ImuNoise& noise,
                             double gravity_mps2,
                             double dt_s) {
  return Measure(samples, x, imu, noise, gravity_mps2, dt_s, std::nullopt);
}

KeyframeMotion MeasureMotion(const KeyframeContext& context,
                             const KeyframeState& x,
                             const ImuCalibration& imu,
                             const ImuNoise& noise,
                             double gravity_mps2,
                             const CameraCalibration& camera) {
  const double first_row_s = TimeOffsetAt(camera, context.session_s);
  const double dt_s = MiddleRowDelay(camera, context.session_s);
  std::optional<double> half_readout_s;
  if (camera.line_delay_s) {
    half_readout_s =
        std::max(std::abs(dt_s - first_row_s), kLeastHalfReadout_s);
  }
  KeyframeMotion motion = Measure(
      context.samples, x, imu, noise, gravity_mps2, dt_s, half_readout_s);
  motion.session_s = context.session_s;
  return motion;
}

ExposurePose MovePose(const Eigen::Quaterniond& q_GI,
                      const Vector3d& p_GI,
                      const KeyframeMotion& motion,
                      double exposure_s) {
  const double dt_s = exposure_s - motion.dt_s;
  ExposurePose pose = Moved(q_GI,
                            p_GI,
                            motion.turn * Exp(dt_s * motion.w_I),
                            motion.shift_I + dt_s * motion.v_I);
  pose.by_time << motion.w_I, q_GI.toRotationMatrix() * motion.v_I;
  return pose;
}

ExposurePose MovePose(const Eigen::Quaterniond& q_GI,
                      const Vector3d& p_GI,
                      const KeyframeMotion& motion,
                      const CameraCalibration& camera,
                      const Eigen::Vector2d& z_px) {
  const double first_row_s = TimeOffsetAt(camera, motion.session_s);
  if (!camera.line_delay_s) {
    return MovePose(q_GI, p_GI, motion, first_row_s);
  }
  const double s = first_row_s + *camera.line_delay_s * z_px.y() - motion.dt_s;
  const Vector3d powers(s, s * s, s * s * s);
  const Vector3d slopes(1, 2 * s, 3 * s * s);
  const ReadoutMotion& readout = motion.readout;
  const Vector3d phi = readout.turn * powers;
  ExposurePose pose =
      Moved(q_GI,
            p_GI,
            motion.turn * Exp(phi),
            motion.shift_I + motion.turn * (readout.shift * powers));
  pose.by_time << readout.rate_share * RightJacobian(phi) *
                      (readout.turn * slopes),
      q_GI * (motion.turn * (readout.shift * slopes));
  return pose;
}

ExposurePose PoseAtRest(const Eigen::Quaterniond& q_GI, const Vector3d& p_GI) {
  ExposurePose pose{q_GI, p_GI, {}, Eigen::Matrix<double, 6, 1>::Zero()};
  pose.by_rotation << Eigen::Matrix3d::Identity(), Eigen::Matrix3d::Zero();
  return pose;
}

void KeyframeMotions::FindCameras(const Calibration& theta,
                                  std::span<const char> estimated) {
  index_.assign(theta.cameras.size(), -1);
  stride_ = 0;
  for (std::size_t j = 0; j < theta.cameras.size(); ++j) {
    const CameraCalibration& camera = theta.cameras[j];
    if (estimated[j] || camera.time_offset_s != 0 || camera.line_delay_s ||
        camera.time_drift) {
      index_[j] = stride_++;
    }
  }
  if (stride_ == 0) index_.clear();
}

KeyframeMotions SegmentMotions(const Rig& rig,
                               const Calibration& theta,
                               const MotionSegment& segment) {
  KeyframeMotions motions;
  motions.Measure(rig,
                  theta,
                  EstimatedTimeOffsets(rig),
                  segment.keyframes,
                  [&](std::size_t k) { return ContextOf(segment, k); });
  return motions;
}

}  // namespace selfcal
