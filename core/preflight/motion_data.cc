#include "core/preflight/motion_data.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "core/model/so3.h"

namespace selfcal {
namespace {

constexpr double kMinInterval_s = 0.25;
constexpr double kMaxInterval_s = 3;
constexpr std::size_t kMaxIntervals = 2000;

void CollectIntervals(const std::vector<KeyframeState>& keyframes,
                      std::size_t segment,
                      std::vector<MotionInterval>* intervals) {
  std::size_t from = 0;
  for (std::size_t k = 1; k < keyframes.size(); ++k) {
    const KeyframeState& a = keyframes[from];
    const KeyframeState& b = keyframes[k];
    const double dt_s = 1e-9 * static_cast<double>(b.t_ns - a.t_ns);
    if (dt_s >= 0 && dt_s < kMinInterval_s) continue;
    from = k;
    if (dt_s < 0 || dt_s > kMaxInterval_s || !IsFinite(a) || !IsFinite(b))
      continue;
    const Eigen::Quaterniond turn =
        a.q_GI.normalized().conjugate() * b.q_GI.normalized();
    intervals->push_back({segment, a, b, dt_s, Log(turn)});
  }
}

}  // namespace

bool IsFinite(const KeyframeState& state) {
  return state.q_GI.coeffs().allFinite() && state.q_GI.norm() > 0.5 &&
         state.p_GI.allFinite() && state.v_GI.allFinite() &&
         state.b_a.allFinite() && state.b_g.allFinite();
}

std::vector<ImuSample> UsableSamples(std::span<const ImuSample> samples) {
  std::vector<ImuSample> usable;
  usable.reserve(samples.size());
  for (const ImuSample& sample : samples) {
    if (!sample.gyro.allFinite() || !sample.accel.allFinite()) continue;
    if (!usable.empty() && sample.t_ns <= usable.back().t_ns) continue;
    usable.push_back(sample);
  }
  return usable;
}

MotionData CollectMotion(std::span<const MotionSegment> segments) {
  MotionData data;
  std::vector<MotionInterval> all;
  for (const MotionSegment& segment : segments) {
    data.imu.push_back(UsableSamples(segment.imu));
    if (data.imu.back().size() < 2) continue;
    CollectIntervals(segment.keyframes, data.imu.size() - 1, &all);
    if (segment.keyframes.empty()) continue;
    data.session_s += SessionTime(segment, segment.keyframes.front()) /
                      static_cast<double>(segments.size());
  }
  const std::size_t step = all.size() / kMaxIntervals + 1;
  for (std::size_t i = 0; i < all.size(); i += step) {
    data.intervals.push_back(all[i]);
  }
  return data;
}

MotionData InBody(const MotionData& data, const Eigen::Matrix3d& R_BI) {
  const Eigen::Quaterniond q_BI(R_BI);
  MotionData turned = data;
  for (MotionInterval& interval : turned.intervals) {
    interval.from.q_GI = interval.from.q_GI.normalized() * q_BI;
    interval.to.q_GI = interval.to.q_GI.normalized() * q_BI;
    interval.turn = q_BI.conjugate() * interval.turn;
  }
  return turned;
}

double TrimmedRms(std::vector<double>* norms) {
  const std::size_t count = (norms->size() * 9 + 9) / 10;
  if (count == 0) return 0;
  std::sort(norms->begin(), norms->end());
  double sum = 0;
  for (std::size_t i = 0; i < count; ++i) sum += (*norms)[i] * (*norms)[i];
  return std::sqrt(sum / static_cast<double>(count));
}

std::string Figure(double value) {
  std::array<char, 32> text;
  std::snprintf(text.data(), text.size(), "%.3g", value);
  return text.data();
}

}  // namespace selfcal
