#include "core/preflight/forces.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

#include "core/model/imu_model.h"
#include "core/model/median.h"
#include "core/model/so3.h"

namespace selfcal {
namespace {

// Fills means over the samples within [t0, t1]; false if there are too few.
bool Average(const std::vector<ImuSample>& samples,
             const MotionInterval& interval,
             const Eigen::Matrix3d& corrected_by_read,
             std::int64_t shift,
             ForceInterval* force) {
  constexpr int kMinSamples = 5;
  const std::int64_t t0 = interval.from.t_ns + shift;
  const std::int64_t t1 = interval.to.t_ns + shift;
  if (t0 < samples.front().t_ns || t1 > samples.back().t_ns) return false;
  auto next = std::lower_bound(
      samples.begin(), samples.end(), t0, [](const auto& s, std::int64_t t) {
        return s.t_ns < t;
      });
  force->turned.fill(Eigen::Matrix3d::Zero());
  force->bias.setZero();
  int count = 0;
  for (; next != samples.end() && next->t_ns <= t1; ++next, ++count) {
    const double part = 1e-9 * static_cast<double>(next->t_ns - t0);
    const Eigen::Matrix3d R = (interval.from.q_GI.normalized() *
                               Exp(part / interval.dt_s * interval.turn))
                                  .toRotationMatrix() *
                              corrected_by_read;
    for (int k = 0; k < 3; ++k) force->turned[k] += next->accel[k] * R;
    force->bias += R * interval.from.b_a;
  }
  if (count < kMinSamples) return false;
  for (Eigen::Matrix3d& turned : force->turned) turned /= count;
  force->bias /= count;
  return true;
}

}  // namespace

std::vector<ForceInterval> CollectForces(const MotionData& data,
                                         const ImuCalibration& imu,
                                         double offset_s) {
  const Eigen::Matrix3d corrected_by_read =
      ImuModel<double>(CorrectionOf(imu)).ForceByAccel();
  const std::int64_t shift = std::llround(offset_s * 1e9);
  std::vector<ForceInterval> forces;
  for (const MotionInterval& interval : data.intervals) {
    ForceInterval force;
    if (!Average(data.imu[interval.segment],
                 interval,
                 corrected_by_read,
                 shift,
                 &force)) {
      continue;
    }
    force.acceleration =
        (interval.to.v_GI - interval.from.v_GI) / interval.dt_s;
    forces.push_back(force);
  }
  return forces;
}

double MedianAcceleration(const MotionData& data) {
  std::vector<double> norms;
  for (const auto& samples : data.imu) {
    for (const ImuSample& sample : samples) {
      norms.push_back(sample.accel.norm());
    }
  }
  return UpperMedian(std::move(norms));
}

}  // namespace selfcal
