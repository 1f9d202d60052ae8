#include "core/simulation/imu_readings.h"

#include <algorithm>
#include <cmath>

#include "core/model/imu_model.h"
#include "core/simulation/random.h"
#include "core/simulation/streams.h"

namespace selfcal {
namespace {

// Samples of the second IMU come this much later than those of the first.
constexpr double kSecondPhase_s = 7e-4;

// An IMU that is simulated: its own parameters, and its place on the body.
struct Simulated {
  const ImuCalibration& imu;
  const ImuNoise& density;
  Eigen::Vector3d b_a0, b_g0;
  std::uint64_t noise_stream, walk_stream;
  double phase_s = 0;
  const SecondImuCalibration* mount = nullptr;  // null: the frame of the body
};

// Noise-free readings and the true signals, without biases.
ImuReadings PerfectReadings(const Rig& rig,
                            const Simulated& of,
                            const Trajectory& trajectory,
                            double rate_hz) {
  const ImuResponse response(of.imu);
  const Eigen::Vector3d g(0, 0, -rig.gravity_mps2);
  const auto end_ns =
      static_cast<std::int64_t>(std::floor(trajectory.duration_s() * 1e9));
  const std::int64_t phase_ns = std::llround(of.phase_s * 1e9);
  ImuReadings readings;
  for (std::int64_t i = 0;; ++i) {
    ImuSample sample;
    sample.t_ns =
        std::llround(static_cast<double>(i) * 1e9 / rate_hz) + phase_ns;
    if (sample.t_ns > end_ns) return readings;
    const BodyMotion motion =
        trajectory.At(static_cast<double>(sample.t_ns) * 1e-9);
    Eigen::Vector3d f = motion.q_GI.conjugate() * (motion.a_GI - g);
    Eigen::Vector3d w = motion.w_I, dw = motion.dw_I;
    if (of.mount != nullptr) {
      const Eigen::Quaterniond& q_JI = of.mount->q_JI;
      const Eigen::Vector3d p_IJ = -(q_JI.conjugate() * of.mount->p_JI);
      f = q_JI * (f + ForceByPosition<double>(w, dw) * p_IJ);
      w = q_JI * w;
      dw = q_JI * dw;
    }
    const Eigen::Vector3d f_A = response.ForceRead(w, dw, f);
    sample.gyro = response.Gyro(w, f_A);
    sample.accel = response.Accel(f_A);
    readings.noise_free.push_back(sample);
    readings.w_I.push_back(w);
    readings.f_I.push_back(f);
  }
}

ImuReadings SimulateReadings(const Rig& rig,
                             const Simulated& of,
                             const Trajectory& trajectory,
                             const SimulationOptions& options) {
  ImuReadings readings =
      PerfectReadings(rig, of, trajectory, options.imu_rate_hz);
  readings.measured = readings.noise_free;
  Random noise(options.seed, of.noise_stream);
  Random walk(options.seed, of.walk_stream);
  const ImuNoise& density = of.density;
  const double on = options.noise ? 1 : 0;
  const double to_sample = on * std::sqrt(options.imu_rate_hz);
  const double to_step = on / std::sqrt(options.imu_rate_hz);
  Eigen::Vector3d b_a = of.b_a0;
  Eigen::Vector3d b_g = of.b_g0;
  for (std::size_t i = 0; i < readings.measured.size(); ++i) {
    readings.noise_free[i].gyro += b_g;
    readings.noise_free[i].accel += b_a;
    readings.measured[i] = readings.noise_free[i];
    readings.measured[i].gyro +=
        density.gyro_noise_density * to_sample * noise.Normal3();
    readings.measured[i].accel +=
        density.accel_noise_density * to_sample * noise.Normal3();
    readings.b_a.push_back(b_a);
    readings.b_g.push_back(b_g);
    b_a += density.accel_bias_random_walk * to_step * walk.Normal3();
    b_g += density.gyro_bias_random_walk * to_step * walk.Normal3();
  }
  return readings;
}

// Biases between samples, linearly interpolated.
struct Biases {
  Eigen::Vector3d b_a, b_g;
};

Biases BiasesAt(const ImuReadings& imu, std::int64_t t_ns) {
  const std::size_t i = SampleBefore(imu.measured, t_ns);
  const std::size_t j = std::min(i + 1, imu.measured.size() - 1);
  const double step =
      static_cast<double>(imu.measured[j].t_ns - imu.measured[i].t_ns);
  const double u =
      step > 0 ? static_cast<double>(t_ns - imu.measured[i].t_ns) / step : 0;
  return {imu.b_a[i] + u * (imu.b_a[j] - imu.b_a[i]),
          imu.b_g[i] + u * (imu.b_g[j] - imu.b_g[i])};
}

}  // namespace

ImuReadings SimulateImu(const Rig& rig,
                        const ImuCalibration& imu,
                        const Trajectory& trajectory,
                        const SimulationOptions& options) {
  return SimulateReadings(rig,
                          {.imu = imu,
                           .density = rig.imu_noise,
                           .b_a0 = options.b_a0,
                           .b_g0 = options.b_g0,
                           .noise_stream = kImuNoiseStream,
                           .walk_stream = kBiasWalkStream},
                          trajectory,
                          options);
}

ImuReadings SimulateSecondImu(const Rig& rig,
                              const SecondImuCalibration& imu,
                              const Trajectory& trajectory,
                              const SimulationOptions& options) {
  ImuReadings readings =
      SimulateReadings(rig,
                       {.imu = imu,
                        .density = rig.imu1_noise,
                        .b_a0 = options.second_b_a0,
                        .b_g0 = options.second_b_g0,
                        .noise_stream = kSecondImuNoiseStream,
                        .walk_stream = kSecondBiasWalkStream,
                        .phase_s = kSecondPhase_s,
                        .mount = &imu},
                       trajectory,
                       options);
  for (auto* samples : {&readings.measured, &readings.noise_free}) {
    for (ImuSample& sample : *samples) {
      sample.t_ns -= std::llround(1e9 * imu.time_offset_s);
    }
  }
  return readings;
}

void AddSecondMotion(const Trajectory& trajectory,
                     const SecondImuCalibration& imu,
                     const ImuReadings& readings,
                     KeyframeState* state) {
  const BodyMotion motion =
      trajectory.At(static_cast<double>(state->t_ns) * 1e-9);
  const Eigen::Vector3d p_IJ = -(imu.q_JI.conjugate() * imu.p_JI);
  const Biases biases = BiasesAt(readings, state->t_ns);
  state->v_GJ = motion.v_GI + motion.q_GI * motion.w_I.cross(p_IJ);
  state->b_a1 = biases.b_a;
  state->b_g1 = biases.b_g;
}

std::vector<std::size_t> SamplesThatArrive(
    const std::vector<ImuSample>& samples,
    std::size_t from,
    std::size_t to,
    const SimulationOptions& options,
    Random* random) {
  const std::int64_t gap_ns = std::llround(options.imu_gap_s * 1e9);
  std::int64_t gap_begin_ns = 0;
  const std::int64_t room_ns = samples[to].t_ns - samples[from].t_ns - gap_ns;
  const bool gap = gap_ns > 0 && room_ns > 0;
  if (gap) {
    const double at = random->Uniform(0, static_cast<double>(room_ns));
    gap_begin_ns =
        samples[SampleBefore(samples, samples[from].t_ns + std::llround(at))]
            .t_ns;
  }
  std::vector<std::size_t> arrived;
  for (std::size_t i = from; i <= to; ++i) {
    const bool lost = options.imu_lost_fraction > 0 &&
                      random->Chance(options.imu_lost_fraction);
    const bool in_gap = gap && samples[i].t_ns > gap_begin_ns &&
                        samples[i].t_ns < gap_begin_ns + gap_ns;
    if (i == from || i == to || !(lost || in_gap)) arrived.push_back(i);
  }
  return arrived;
}

std::size_t SampleBefore(const std::vector<ImuSample>& samples,
                         std::int64_t t_ns) {
  const auto after = std::upper_bound(
      samples.begin(),
      samples.end(),
      t_ns,
      [](std::int64_t t, const ImuSample& sample) { return t < sample.t_ns; });
  return static_cast<std::size_t>(after - samples.begin()) - 1;
}

KeyframeState TrueState(const Trajectory& trajectory,
                        const ImuReadings& imu,
                        std::int64_t t_ns) {
  const BodyMotion motion = trajectory.At(static_cast<double>(t_ns) * 1e-9);
  const Biases biases = BiasesAt(imu, t_ns);
  KeyframeState state;
  state.t_ns = t_ns;
  state.q_GI = motion.q_GI;
  state.p_GI = motion.p_GI;
  state.v_GI = motion.v_GI;
  state.b_a = biases.b_a;
  state.b_g = biases.b_g;
  return state;
}

}  // namespace selfcal
