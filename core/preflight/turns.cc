#include "core/preflight/turns.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "core/factor/preintegration.h"
#include "core/model/so3.h"
#include "core/preflight/signed_permutation.h"

namespace selfcal {
namespace {

std::int64_t Nanoseconds(double s) { return std::llround(s * 1e9); }

// Residual of each interval; nullopt if no samples cover it.
std::vector<std::optional<Eigen::Vector3d>> Residuals(
    const MotionData& data,
    const ImuCalibration& imu,
    const RateHypothesis& hypothesis) {
  std::vector<std::optional<Eigen::Vector3d>> residuals;
  std::vector<ImuSample> samples;
  std::size_t of = data.imu.size();
  for (const MotionInterval& interval : data.intervals) {
    if (interval.segment != of) {
      of = interval.segment;
      samples = data.imu[of];
      for (ImuSample& s : samples) s.gyro = hypothesis.M * s.gyro;
    }
    const std::int64_t shift = Nanoseconds(hypothesis.offset_s);
    const std::int64_t t0 = interval.from.t_ns + shift;
    const std::int64_t t1 = interval.to.t_ns + shift;
    if (t0 < samples.front().t_ns || t1 > samples.back().t_ns) {
      residuals.emplace_back();
      continue;
    }
    const Preintegration motion = Preintegrate(samples,
                                               t0,
                                               t1,
                                               imu,
                                               interval.from.b_a,
                                               interval.from.b_g,
                                               {},
                                               {false, false});
    residuals.push_back(Log(Exp(interval.turn).conjugate() * motion.Delta_R));
  }
  return residuals;
}

// Integrals of the received rates from the first sample of a segment to each.
std::vector<Eigen::Vector3d> SumRates(const std::vector<ImuSample>& samples) {
  std::vector<Eigen::Vector3d> sums(samples.size(), Eigen::Vector3d::Zero());
  for (std::size_t i = 1; i < samples.size(); ++i) {
    const double h =
        1e-9 * static_cast<double>(samples[i].t_ns - samples[i - 1].t_ns);
    sums[i] = sums[i - 1] + h / 2 * (samples[i].gyro + samples[i - 1].gyro);
  }
  return sums;
}

Eigen::Vector3d SumAt(const std::vector<ImuSample>& samples,
                      const std::vector<Eigen::Vector3d>& sums,
                      std::int64_t t_ns) {
  const auto next = std::lower_bound(
      samples.begin() + 1,
      samples.end() - 1,
      t_ns,
      [](const ImuSample& s, std::int64_t t) { return s.t_ns < t; });
  const auto i = static_cast<std::size_t>(next - samples.begin());
  const double part =
      static_cast<double>(t_ns - samples[i - 1].t_ns) /
      static_cast<double>(samples[i].t_ns - samples[i - 1].t_ns);
  return sums[i - 1] + part * (sums[i] - sums[i - 1]);
}

using RateSums = std::vector<std::vector<Eigen::Vector3d>>;

RateSums SumRates(const MotionData& data) {
  RateSums sums;
  for (const auto& samples : data.imu) sums.push_back(SumRates(samples));
  return sums;
}

// Second moments of rotations and summed rates at one offset.
struct Moments {
  int count = 0;
  Eigen::Matrix3d cross = Eigen::Matrix3d::Zero();  // rotation sum^T
  double turn = 0;
  double sum = 0;

  // Mean square of (rotation - unit axes sum) over that of the rotations.
  double Left(const Eigen::Matrix3d& axes, double unit) const {
    const double match = axes.cwiseProduct(cross).sum();
    return (turn + unit * unit * sum - 2 * unit * match) / turn;
  }
};

Moments MomentsAt(const MotionData& data,
                  const RateSums& sums,
                  double offset_s) {
  Moments m;
  const std::int64_t shift = Nanoseconds(offset_s);
  for (const MotionInterval& interval : data.intervals) {
    const std::vector<ImuSample>& samples = data.imu[interval.segment];
    const std::int64_t t0 = interval.from.t_ns + shift;
    const std::int64_t t1 = interval.to.t_ns + shift;
    if (t0 < samples.front().t_ns || t1 > samples.back().t_ns) continue;
    const auto& of = sums[interval.segment];
    const Eigen::Vector3d sum = SumAt(samples, of, t1) - SumAt(samples, of, t0);
    ++m.count;
    m.cross += interval.turn * sum.transpose();
    m.turn += interval.turn.squaredNorm();
    m.sum += sum.squaredNorm();
  }
  return m;
}

}  // namespace

double MeanSpeed(const MotionData& data) {
  double turn = 0, time = 0;
  for (const MotionInterval& interval : data.intervals) {
    turn += interval.turn.squaredNorm();
    time += interval.dt_s * interval.dt_s;
  }
  return time > 0 ? std::sqrt(turn / time) : 0;
}

bool Turns(const MotionData& data) {
  constexpr double kMinSpeed_radps = 0.05;
  return data.intervals.size() >= kMinIntervals &&
         MeanSpeed(data) >= kMinSpeed_radps;
}

RateFit FitRates(const MotionData& data,
                 const ImuCalibration& imu,
                 const RateHypothesis& hypothesis) {
  const auto residuals = Residuals(data, imu, hypothesis);
  std::vector<double> errors, turns;
  for (std::size_t i = 0; i < residuals.size(); ++i) {
    if (!residuals[i]) continue;
    errors.push_back(residuals[i]->norm());
    turns.push_back(data.intervals[i].turn.norm());
  }
  RateFit fit;
  fit.intervals = static_cast<int>(errors.size());
  fit.turn_rad = TrimmedRms(&turns);
  fit.error_rad = TrimmedRms(&errors);
  return fit;
}

OffsetFit RefineOffset(const MotionData& data,
                       const ImuCalibration& imu,
                       const RateHypothesis& hypothesis) {
  constexpr double kStep_s = 2e-3;
  constexpr int kIterations = 4;
  RateHypothesis at = hypothesis;
  OffsetFit fit;
  for (int n = 0; n < kIterations; ++n) {
    const auto here = Residuals(data, imu, at);
    const auto later = Residuals(data, imu, {at.M, at.offset_s + kStep_s});
    const auto earlier = Residuals(data, imu, {at.M, at.offset_s - kStep_s});
    std::vector<double> norms;
    for (const auto& r : here) {
      if (r) norms.push_back(r->norm());
    }
    const double scale = TrimmedRms(&norms);
    double information = 0, gradient = 0, squares = 0, weights = 0;
    for (std::size_t i = 0; i < here.size(); ++i) {
      if (!here[i] || !later[i] || !earlier[i]) continue;
      const Eigen::Vector3d J = (*later[i] - *earlier[i]) / (2 * kStep_s);
      const double norm = here[i]->norm();
      const double weight = norm > 2 * scale ? 2 * scale / norm : 1;
      information += weight * J.squaredNorm();
      gradient += weight * J.dot(*here[i]);
      squares += weight * norm * norm;
      weights += 3 * weight;
    }
    if (!(information > 0)) return {0, std::numeric_limits<double>::max()};
    at.offset_s -= gradient / information;
    fit = {at.offset_s, std::sqrt(squares / weights / information)};
  }
  return fit;
}

CoarseAlignment AlignRates(const MotionData& data, double unit) {
  constexpr double kMaxOffset_s = 0.5;
  // Tolerance of the relative mean square, for the error of the coarse sum.
  constexpr double kCloser = 0.3;
  const RateSums sums = SumRates(data);
  const int needed = MomentsAt(data, sums, 0).count / 2;
  CoarseAlignment best;
  double straight = std::numeric_limits<double>::max();
  double turned = straight;
  Moments at;
  const int steps = static_cast<int>(std::lround(kMaxOffset_s / kCoarseStep_s));
  for (int n = -steps; n <= steps; ++n) {
    const double offset_s = n * kCoarseStep_s;
    const Moments m = MomentsAt(data, sums, offset_s);
    if (m.count < needed || !(m.turn > 0)) continue;
    for (const Eigen::Matrix3d& axes : SignedPermutations()) {
      const double left = m.Left(axes, unit);
      if (axes.isIdentity() && left < straight) {
        straight = left;
        best.straight_s = offset_s;
      }
      if (left >= turned) continue;
      turned = left;
      best.turned_s = offset_s;
      at = m;
    }
  }
  for (const Eigen::Matrix3d& axes : SignedPermutations()) {
    if (at.turn > 0 && at.Left(axes, unit) < turned + kCloser) {
      best.axes.push_back(axes);
    }
  }
  return best;
}

double SpeedRatio(const MotionData& data) {
  const Moments m = MomentsAt(data, SumRates(data), 0);
  return m.turn > 0 ? std::sqrt(m.sum / m.turn) : 0;
}

}  // namespace selfcal
