// OpenVINS with its own simulator, connected to selfcald: the filter begins
// with the factory calibration of a rig, its data goes to the daemon, and each
// calibration that becomes active is applied while it runs. Prints the filter's
// errors for every version that it ran with.
//
//   run_openvins TARGET RIG CONFIG [SECONDS] [PACE]
//
// CONFIG is OpenVINS's estimator_config.yaml; its calibration is the truth of
// the simulation. SECONDS end it earlier, and it takes PACE times as long as
// the simulated motion [1].
//
// Licence: GPL-3.0-or-later, as selfcal_openvins.h.
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "selfcal_openvins.h"
#include "sim/Simulator.h"
#include "utils/opencv_yaml_parse.h"
#include "utils/print.h"

namespace {

using Features = std::vector<std::pair<std::size_t, Eigen::VectorXf>>;

// Squared errors of velocity and of the direction of gravity, which do not
// drift, while one version was used.
struct Errors {
  int count = 0;
  double velocity = 0;  // [m^2/s^2]
  double tilt = 0;      // [rad^2]
  double sigmas = 0;    // of the velocity, squared and normalised
};

// The points of one time.
struct Images {
  double timestamp = 0;
  std::vector<int> cameras;
  std::vector<Features> features;
};

void AddErrors(ov_msckf::VioManager* vio,
               ov_msckf::Simulator* simulator,
               Errors* errors) {
  const std::shared_ptr<ov_msckf::State> state = vio->get_state();
  Eigen::Matrix<double, 17, 1> truth;
  const double true_offset_s = simulator->get_true_parameters().calib_camimu_dt;
  if (!simulator->get_state(state->_timestamp + true_offset_s, truth)) return;
  const Eigen::Vector3d error =
      state->_imu->vel() - Eigen::Vector3d(truth.segment<3>(8));
  const Eigen::Vector3d up(0, 0, 1);
  const Eigen::Vector3d estimated = state->_imu->Rot() * up;
  const Eigen::Vector3d true_up =
      ov_core::quat_2_Rot(Eigen::Vector4d(truth.segment<4>(1))) * up;
  const Eigen::Matrix3d covariance =
      ov_msckf::StateHelper::get_marginal_covariance(state, {state->_imu->v()});
  ++errors->count;
  errors->velocity += error.squaredNorm();
  errors->tilt += estimated.cross(true_up).squaredNorm();
  errors->sigmas += error.dot(covariance.inverse() * error);
}

void Print(const std::map<std::int64_t, Errors>& errors) {
  std::printf("%8s %8s %16s %12s %8s\n",
              "version",
              "images",
              "velocity [m/s]",
              "tilt [deg]",
              "NEES/3");
  for (const auto& entry : errors) {
    const Errors& e = entry.second;
    std::printf("%8lld %8d %16.4f %12.3f %8.2f\n",
                static_cast<long long>(entry.first),
                e.count,
                std::sqrt(e.velocity / e.count),
                std::sqrt(e.tilt / e.count) * 180 / M_PI,
                e.sigmas / e.count / 3);
  }
}

void PrintDifference(const char* name,
                     const selfcal::Calibration& truth,
                     const selfcal::Calibration& used) {
  const selfcal_camera a = truth.camera(0);
  const selfcal_camera b = used.camera(0);
  const selfcal_imu true_imu = truth.imu();
  const selfcal_imu used_imu = used.imu();
  std::printf(
      "%s: camera 0 is off by %.3f, %.3f px (f), %.3f, %.3f px (c), %.3f ms, "
      "%.2f, %.2f, %.2f mm; accelerometer by %.2f, %.2f, %.2f per mille\n",
      name,
      b.f[0] - a.f[0],
      b.f[1] - a.f[1],
      b.c[0] - a.c[0],
      b.c[1] - a.c[1],
      1e3 * (b.time_offset_s - a.time_offset_s),
      1e3 * (b.p_CI[0] - a.p_CI[0]),
      1e3 * (b.p_CI[1] - a.p_CI[1]),
      1e3 * (b.p_CI[2] - a.p_CI[2]),
      1e3 * (used_imu.accel_scale[0] - true_imu.accel_scale[0]),
      1e3 * (used_imu.accel_scale[1] - true_imu.accel_scale[1]),
      1e3 * (used_imu.accel_scale[2] - true_imu.accel_scale[2]));
}

int Run(const selfcal::ClientOptions& client,
        const std::string& config,
        double seconds,
        double pace) {
  const auto parser = std::make_shared<ov_core::YamlParser>(config);
  ov_core::Printer::setPrintLevel("WARNING");
  ov_msckf::VioManagerOptions params;
  params.print_and_load(parser);
  params.print_and_load_simulation(parser);
  params.num_opencv_threads = 0;
  if (!parser->successful()) {
    std::fprintf(stderr, "%s cannot be read\n", config.c_str());
    return 2;
  }
  ov_msckf::Simulator simulator(params);
  ov_msckf::VioManager vio(params);
  const selfcal::Calibration truth =
      selfcal::openvins::CalibrationOf(*vio.get_state());

  selfcal::openvins::Options options;
  options.gravity_mps2 = params.gravity_mag;
  options.session =
      "openvins-" +
      std::to_string(
          std::chrono::system_clock::now().time_since_epoch().count());
  selfcal::openvins::Adapter adapter(
      client, options, [](const selfcal::Acknowledgement& ack) {
        for (const selfcal::Violation& violation : ack.violations) {
          std::fprintf(stderr,
                       "segment %lld: %s %s\n",
                       static_cast<long long>(ack.index),
                       violation.field.c_str(),
                       violation.message.c_str());
        }
      });
  if (!adapter.WaitForCalibration(std::chrono::seconds(10), &vio)) {
    std::fprintf(stderr, "%s\n", adapter.problem().c_str());
    return 1;
  }
  PrintDifference("at the start",
                  truth,
                  selfcal::openvins::CalibrationOf(*vio.get_state()));

  const double begin_s = simulator.current_timestamp();
  Eigen::Matrix<double, 17, 1> state;
  if (!simulator.get_state(begin_s + 1 / params.sim_freq_imu, state)) return 2;
  state(0) -= simulator.get_true_parameters().calib_camimu_dt;
  vio.initialize_with_gt(state);

  std::map<std::int64_t, Errors> errors;
  Images waiting;
  bool has_waiting = false;
  const auto started = std::chrono::steady_clock::now();
  while (simulator.ok() && simulator.current_timestamp() - begin_s < seconds) {
    std::this_thread::sleep_until(
        started + std::chrono::duration_cast<std::chrono::nanoseconds>(
                      std::chrono::duration<double>(
                          pace * (simulator.current_timestamp() - begin_s))));
    ov_core::ImuData reading;
    if (simulator.get_next_imu(reading.timestamp, reading.wm, reading.am)) {
      vio.feed_measurement_imu(reading);
      adapter.AddReading(reading);
    }
    // Images wait until the readings have passed them, as in a filter that
    // runs live.
    Images next;
    if (!simulator.get_next_cam(next.timestamp, next.cameras, next.features)) {
      continue;
    }
    if (has_waiting) {
      vio.feed_measurement_simulation(
          waiting.timestamp, waiting.cameras, waiting.features);
      AddErrors(&vio, &simulator, &errors[adapter.version()]);
      if (adapter.AddImages(waiting.timestamp, waiting.cameras, &vio)) {
        std::printf("version %lld is applied after %.1f s\n",
                    static_cast<long long>(adapter.version()),
                    simulator.current_timestamp() - begin_s);
        std::fflush(stdout);
      } else if (!adapter.problem().empty()) {
        std::fprintf(stderr, "%s\n", adapter.problem().c_str());
        return 1;
      }
    }
    waiting = next;
    has_waiting = true;
  }
  const selfcal::Status end = adapter.Finish(std::chrono::seconds(60));
  if (!end.ok()) std::fprintf(stderr, "%s\n", end.message().c_str());
  PrintDifference(
      "at the end", truth, selfcal::openvins::CalibrationOf(*vio.get_state()));
  Print(errors);
  const selfcal_stream_statistics sent = adapter.stream().statistics();
  std::printf(
      "segments: %llu stored, %llu rejected, %llu dropped; tracks: %llu "
      "triangulated, %llu dropped\n",
      static_cast<unsigned long long>(sent.stored),
      static_cast<unsigned long long>(sent.rejected),
      static_cast<unsigned long long>(sent.dropped),
      static_cast<unsigned long long>(sent.tracks_triangulated),
      static_cast<unsigned long long>(sent.tracks_dropped));
  return end.ok() && sent.rejected == 0 ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 4 || argc > 6) {
    std::fprintf(
        stderr, "usage: %s TARGET RIG CONFIG [SECONDS] [PACE]\n", argv[0]);
    return 2;
  }
  selfcal::ClientOptions client;
  client.target = argv[1];
  client.rig = argv[2];
  try {
    return Run(client,
               argv[3],
               argc > 4 ? std::atof(argv[4]) : 1e9,
               argc > 5 ? std::atof(argv[5]) : 1);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 2;
  }
}
