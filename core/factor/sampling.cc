#include "core/factor/sampling.h"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "core/model/median.h"

namespace selfcal {
namespace {

constexpr double kSecondsPerNanosecond = 1e-9;
// Steps that differ by less are regular: the error of their noise is below
// this.
constexpr double kRegular = 1.1;
// Limit of the steps that determine the usual step of an interval: the first
// ones.
constexpr std::size_t kMostSteps = 256;
// The signal is used only up to this distance from a gap: beyond it, a
// hand-held motion has reversed.
constexpr double kLongestBase_s = 0.1;

double Seconds(const ImuSample& a, const ImuSample& b) {
  return kSecondsPerNanosecond * static_cast<double>(b.t_ns - a.t_ns);
}

using Reading = Eigen::Matrix<double, 6, 1>;  // gyro, accel

Reading At(const ImuSample& sample) {
  Reading reading;
  reading << sample.gyro, sample.accel;
  return reading;
}

// Average change of the readings between a gap and a point `base_s` beyond one
// of its ends, at sample `end`; from there `step` leads from sample to sample.
// Zero if there is no such sample.
struct Slope {
  Reading rate = Reading::Zero();
  double base_s = 0;
};

Slope SlopeBeyond(std::span<const ImuSample> samples,
                  std::size_t end,
                  std::ptrdiff_t step,
                  double reach_s) {
  Slope slope;
  auto i = static_cast<std::ptrdiff_t>(end);
  while (slope.base_s < reach_s && i + step >= 0 &&
         i + step < std::ssize(samples)) {
    i += step;
    slope.base_s = std::abs(Seconds(samples[end], samples[i]));
  }
  if (slope.base_s > 0) {
    slope.rate = (At(samples[i]) - At(samples[end])) /
                 (static_cast<double>(step) * slope.base_s);
  }
  return slope;
}

// Error of the mean of a linear interpolation over the gap that ends with
// sample `next`: for the gyroscope and for the accelerometer.
StepDensities MissedByLine(std::span<const ImuSample> samples,
                           std::size_t next) {
  const double gap_s = Seconds(samples[next - 1], samples[next]);
  const double reach_s = std::min(gap_s, kLongestBase_s);
  const Reading across = (At(samples[next]) - At(samples[next - 1])) / gap_s;
  StepDensities missed;
  for (const Slope& slope : {SlopeBeyond(samples, next - 1, -1, reach_s),
                             SlopeBeyond(samples, next, 1, reach_s)}) {
    if (slope.base_s == 0) continue;
    // The slopes are those at the middle of the gap and of the base.
    const Reading second =
        (across - slope.rate) / (0.5 * (gap_s + slope.base_s));
    const double by_second = gap_s * gap_s / 12;
    missed.gyro = std::max(missed.gyro, by_second * second.head<3>().norm());
    missed.accel = std::max(missed.accel, by_second * second.tail<3>().norm());
  }
  return missed;
}

}  // namespace

SampleGaps FindGaps(std::span<const ImuSample> samples) {
  SampleGaps gaps;
  if (samples.size() < 2) return gaps;
  double shortest_s = Seconds(samples[0], samples[1]);
  double longest_s = shortest_s;
  for (std::size_t i = 1; i < samples.size(); ++i) {
    const double step_s = Seconds(samples[i - 1], samples[i]);
    shortest_s = std::min(shortest_s, step_s);
    longest_s = std::max(longest_s, step_s);
  }
  // The usual step lies in between and need not be determined.
  if (longest_s <= kGapRatio * shortest_s) return gaps;
  std::vector<double> steps;
  for (std::size_t i = 1; i < samples.size(); ++i) {
    steps.push_back(Seconds(samples[i - 1], samples[i]));
  }
  const double usual_s = UpperMedianInPlace(std::span(steps));
  for (const double step_s : steps) {
    if (step_s <= kGapRatio * usual_s) continue;
    ++gaps.count;
    gaps.longest_s = std::max(gaps.longest_s, step_s);
  }
  return gaps;
}

Sampling::Sampling(std::span<const ImuSample> samples,
                   std::int64_t t0_ns,
                   std::int64_t t1_ns,
                   const ImuNoise& noise)
    : samples_(samples), noise_(noise) {
  const auto at_or_after = [&](std::int64_t t_ns) {
    return std::lower_bound(
               samples.begin(),
               samples.end(),
               t_ns,
               [](const ImuSample& s, std::int64_t t) { return s.t_ns < t; }) -
           samples.begin();
  };
  const std::ptrdiff_t first =
      std::max<std::ptrdiff_t>(at_or_after(t0_ns) - kSamplesBeyond, 0) + 1;
  const std::ptrdiff_t end = std::min<std::ptrdiff_t>(
      at_or_after(t1_ns) + kSamplesBeyond, std::ssize(samples));
  if (first >= end) return;
  double shortest_s = Step(first), longest_s = shortest_s;
  for (std::ptrdiff_t i = first; i < end; ++i) {
    shortest_s = std::min(shortest_s, Step(i));
    longest_s = std::max(longest_s, Step(i));
  }
  regular_ = longest_s <= kRegular * shortest_s;
  if (regular_) return;
  std::array<double, kMostSteps> steps;
  std::size_t count = 0;
  for (std::ptrdiff_t i = first; i < end && count < kMostSteps; ++i) {
    steps[count++] = Step(i);
  }
  period_s_ = UpperMedianInPlace(std::span(steps).first(count));
}

double Sampling::Step(std::size_t next) const {
  return Seconds(samples_[next - 1], samples_[next]);
}

StepDensities Sampling::OfIrregular(std::size_t next) const {
  if (next == 0 || next == samples_.size()) {
    return {noise_.gyro_noise_density, noise_.accel_noise_density};
  }
  const double step_s = Step(next);
  const double before_s = next > 1 ? Step(next - 1) : step_s;
  const double after_s = next + 1 < samples_.size() ? Step(next + 1) : step_s;
  const double noise = (step_s + 0.5 * (before_s + after_s)) / (2 * period_s_);
  StepDensities missed;
  if (step_s > kGapRatio * period_s_) missed = MissedByLine(samples_, next);
  const auto density = [&](double of_noise, double missed_mean) {
    return std::sqrt(of_noise * of_noise * noise +
                     missed_mean * missed_mean * step_s);
  };
  return {density(noise_.gyro_noise_density, missed.gyro),
          density(noise_.accel_noise_density, missed.accel)};
}

}  // namespace selfcal
