#include "core/simulation/slam_states.h"

#include <algorithm>
#include <cmath>

#include "core/model/imu_model.h"
#include "core/simulation/random.h"
#include "core/simulation/streams.h"

namespace selfcal {
namespace {

// Correlation times of the errors: loop closures bound position and yaw,
// gravity bounds roll and pitch sooner.
constexpr double kYawTime_s = 20;
constexpr double kTiltTime_s = 5;
constexpr double kPositionTime_s = 20;
constexpr double kVelocityTime_s = 2;
constexpr double kBiasTime_s = 20;
constexpr double kYawFactor = 3;
// Fraction of the standard deviation that is independent in every keyframe.
constexpr double kJitter = 0.2;
// A bias estimate follows the mean error over this time on either side.
constexpr double kBiasWindow_s = 5;

// A stationary first-order Gauss-Markov process in three dimensions.
class Drift {
 public:
  Drift(const Eigen::Vector3d& sigma, double time_s)
      : sigma_(sigma), time_s_(time_s) {}

  // Value dt_s after the last one, including the jitter of this instant.
  Eigen::Vector3d Next(double dt_s, Random* random) {
    const double keep = first_ ? 0 : std::exp(-dt_s / time_s_);
    first_ = false;
    drift_ = keep * drift_ + std::sqrt(1 - keep * keep) * random->Normal3();
    const Eigen::Vector3d jitter = kJitter * random->Normal3();
    return sigma_.cwiseProduct(std::sqrt(1 - kJitter * kJitter) * drift_ +
                               jitter);
  }

 private:
  Eigen::Vector3d sigma_;
  double time_s_;
  Eigen::Vector3d drift_ = Eigen::Vector3d::Zero();
  bool first_ = true;
};

// Running sums of the true signals, for means over any window in constant time.
class WindowMean {
 public:
  WindowMean(const std::vector<ImuSample>& samples,
             const std::vector<Eigen::Vector3d>& values)
      : samples_(samples), sums_(1, Eigen::Vector3d::Zero()) {
    for (const Eigen::Vector3d& value : values) {
      sums_.push_back(sums_.back() + value);
    }
  }

  Eigen::Vector3d Around(std::int64_t t_ns) const {
    const auto half_ns = static_cast<std::int64_t>(kBiasWindow_s * 1e9);
    const std::int64_t first_ns = samples_.front().t_ns;
    const std::int64_t last_ns = samples_.back().t_ns;
    const std::size_t begin =
        SampleBefore(samples_, std::max(first_ns, t_ns - half_ns));
    const std::size_t end =
        SampleBefore(samples_, std::min(last_ns, t_ns + half_ns)) + 1;
    return (sums_[end] - sums_[begin]) / static_cast<double>(end - begin);
  }

 private:
  const std::vector<ImuSample>& samples_;
  std::vector<Eigen::Vector3d> sums_;
};

}  // namespace

std::vector<KeyframeState> SlamStates(const std::vector<KeyframeState>& truth,
                                      const ImuReadings& imu,
                                      const ImuCalibration& imu_true,
                                      const ImuCalibration& imu_slam,
                                      const SimulationOptions& options) {
  using Eigen::Vector3d;
  const Vector3d one = Vector3d::Ones();
  const double rotation = options.slam_rotation_rad;
  Drift tilt(Vector3d(rotation, rotation, 0), kTiltTime_s);
  Drift yaw(Vector3d(0, 0, kYawFactor * rotation), kYawTime_s);
  Drift position(options.slam_position_m * one, kPositionTime_s);
  Drift velocity(options.slam_velocity_mps * one, kVelocityTime_s);
  Drift accel_bias(options.slam_accel_bias_mps2 * one, kBiasTime_s);
  Drift gyro_bias(options.slam_gyro_bias_radps * one, kBiasTime_s);

  ImuResponse mismatch(imu_true);
  mismatch -= ImuResponse(imu_slam);
  const WindowMean mean_w_I(imu.measured, imu.w_I);
  const WindowMean mean_f_I(imu.measured, imu.f_I);

  Random random(options.seed, kSlamStateStream);
  std::vector<KeyframeState> states;
  for (std::size_t k = 0; k < truth.size(); ++k) {
    const std::int64_t t_ns = truth[k].t_ns;
    const double dt_s =
        k > 0 ? static_cast<double>(t_ns - truth[k - 1].t_ns) * 1e-9 : 0;
    Eigen::Matrix<double, 15, 1> error;
    // Tilt and yaw are about the axes of G, the state's tangent is in I.
    const Vector3d rotation_G =
        tilt.Next(dt_s, &random) + yaw.Next(dt_s, &random);
    error.segment<3>(kStateRotation) = truth[k].q_GI.conjugate() * rotation_G;
    error.segment<3>(kStatePosition) = position.Next(dt_s, &random);
    error.segment<3>(kStateVelocity) = velocity.Next(dt_s, &random);
    // The biases absorb the mean error of the readings, but for that due to
    // the positions of the accelerometer.
    const Vector3d w_I = mean_w_I.Around(t_ns);
    const Vector3d f_I = mean_f_I.Around(t_ns);
    error.segment<3>(kStateAccelBias) =
        accel_bias.Next(dt_s, &random) + mismatch.Accel(f_I);
    error.segment<3>(kStateGyroBias) =
        gyro_bias.Next(dt_s, &random) + mismatch.Gyro(w_I, f_I);
    states.push_back(BoxPlus(truth[k], error));
  }
  return states;
}

}  // namespace selfcal
