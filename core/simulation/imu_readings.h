// Simulates readings of an IMU with known intrinsics, biases and noise on a
// trajectory.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "core/model/rig.h"
#include "core/model/segment.h"
#include "core/simulation/random.h"
#include "core/simulation/simulate.h"

namespace selfcal {

// All vectors have one entry for each sample. Signals are those of the frame of
// the IMU and of its origin.
struct ImuReadings {
  std::vector<ImuSample> measured;    // with biases and noise
  std::vector<ImuSample> noise_free;  // with biases
  std::vector<Eigen::Vector3d> w_I;   // true angular rate [rad/s]
  std::vector<Eigen::Vector3d> f_I;   // true specific force [m/s^2]
  std::vector<Eigen::Vector3d> b_a;   // true biases
  std::vector<Eigen::Vector3d> b_g;
};

// Simulates samples from time 0 to the end of the trajectory. Section III-B of
// the paper:
//   w~ = T_g w + b_g + n,  a~ = T_a R_AI R_IG (a_G - g) + b_a + n,
// and of g-sensitivity and positions what ImuCalibration states; with n of
// standard deviation density * sqrt(rate), biases random walks.
ImuReadings SimulateImu(const Rig& rig,
                        const ImuCalibration& imu,
                        const Trajectory& trajectory,
                        const SimulationOptions& options);

// The same of a second IMU, which moves rigidly with the body. Its samples are
// at other times than those of the first one, and have the stamps of its clock.
ImuReadings SimulateSecondImu(const Rig& rig,
                              const SecondImuCalibration& imu,
                              const Trajectory& trajectory,
                              const SimulationOptions& options);

// Adds the true motion of the second IMU, at its time, to a state.
void AddSecondMotion(const Trajectory& trajectory,
                     const SecondImuCalibration& imu,
                     const ImuReadings& readings,
                     KeyframeState* state);

// Selects the samples of a segment that are not lost: indices in [from, to],
// including both ends.
std::vector<std::size_t> SamplesThatArrive(
    const std::vector<ImuSample>& samples,
    std::size_t from,
    std::size_t to,
    const SimulationOptions& options,
    Random* random);

// Index of the last sample at or before t_ns; the samples must extend beyond
// it.
std::size_t SampleBefore(const std::vector<ImuSample>& samples,
                         std::int64_t t_ns);

// True state at t_ns: pose and velocity of the trajectory, biases interpolated
// linearly between samples. t_ns must lie within the samples.
KeyframeState TrueState(const Trajectory& trajectory,
                        const ImuReadings& imu,
                        std::int64_t t_ns);

}  // namespace selfcal
