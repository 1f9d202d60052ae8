// Basalt on a recorded folder in the format of EuRoC, connected to selfcald:
// the odometry begins with the active calibration of a rig, its data goes to
// the daemon, and each calibration that becomes active is applied while it
// runs. Prints Basalt's errors for every version that it ran with.
//
//   run_basalt TARGET RIG TRUTH FOLDER CONFIG CALIBRATION
//     [SECONDS [PACE [PAUSE]]]
//
// TRUTH is a rig whose factory calibration is the true one. FOLDER has two
// cameras and the true states on the clock of the IMU. CONFIG is Basalt's
// configuration, such as its data/euroc_config.json. CALIBRATION is a
// calibration of Basalt's, as `selfcal calibration export --format basalt`
// writes it; its noise and rate of the IMU are used. SECONDS end it earlier,
// and it takes PACE times as long as the recording [1]. After PAUSE seconds it
// waits until a version becomes active, at most 20 minutes: a recording ends,
// where a device would go on while a slow daemon calibrates.
//
// Licence: Apache-2.0. Basalt, whose headers and library this program is built
// from, is under the 3-clause BSD licence.
#include <basalt/io/dataset_io_euroc.h>
#include <basalt/serialization/headers_serialization.h>

#include <algorithm>
#include <cereal/archives/json.hpp>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <deque>
#include <fstream>
#include <limits>
#include <map>
#include <stdexcept>
#include <string>
#include <thread>

#include "selfcal_basalt.h"

namespace {

namespace sb = selfcal::basalt;

constexpr double kStep_s = 1;  // over which the drift is measured

struct Pose {
  Eigen::Matrix3d R_GI = Eigen::Matrix3d::Identity();
  Eigen::Vector3d p_GI = Eigen::Vector3d::Zero();
};

// The true poses, which are sampled as fast as the IMU.
class Truth {
 public:
  explicit Truth(const basalt::VioDataset& data) : data_(data) {}

  // Returns false outside the recording.
  bool At(std::int64_t t_ns, Pose* pose, Eigen::Vector3d* v_GI) const {
    const auto& times = data_.get_gt_timestamps();
    const auto next = std::lower_bound(times.begin(), times.end(), t_ns);
    if (next == times.begin() || next == times.end()) return false;
    const std::size_t i = static_cast<std::size_t>(next - times.begin());
    const Sophus::SE3d& a = data_.get_gt_pose_data()[i - 1];
    const Sophus::SE3d& b = data_.get_gt_pose_data()[i];
    const double dt_s = 1e-9 * static_cast<double>(times[i] - times[i - 1]);
    const double part = 1e-9 * static_cast<double>(t_ns - times[i - 1]) / dt_s;
    const Sophus::SO3d turned =
        a.so3() * Sophus::SO3d::exp(part * (a.so3().inverse() * b.so3()).log());
    pose->R_GI = turned.matrix();
    pose->p_GI = (1 - part) * a.translation() + part * b.translation();
    *v_GI = (b.translation() - a.translation()) / dt_s;
    return true;
  }

 private:
  const basalt::VioDataset& data_;
};

// Squared errors of what does not depend on the world's frame, while one
// version was used.
struct Errors {
  int count = 0;
  double velocity = 0;  // in the frame of the IMU [m^2/s^2]
  double tilt = 0;      // of the direction of gravity [rad^2]
  int steps = 0;
  double drift = 0;  // of the position over kStep_s [m^2]
};

// Compares the states of one version with the truth.
class Comparison {
 public:
  Comparison(const Truth& truth, double true_offset_s)
      : truth_(truth), true_offset_ns_(sb::Nanoseconds(true_offset_s)) {}

  void Add(const selfcal::KeyframeState& state,
           std::int64_t image_t_ns,
           std::int64_t version) {
    At now;
    now.t_ns = image_t_ns;
    now.version = version;
    Eigen::Vector3d v_GI;
    if (!truth_.At(image_t_ns + true_offset_ns_, &now.truth, &v_GI)) return;
    now.estimate.R_GI = sb::EigenOf(state.q_GI).toRotationMatrix();
    now.estimate.p_GI = sb::VectorOf(state.p_GI);
    Errors& errors = errors_[version];
    ++errors.count;
    errors.velocity +=
        (now.estimate.R_GI.transpose() * sb::VectorOf(state.v_GI) -
         now.truth.R_GI.transpose() * v_GI)
            .squaredNorm();
    errors.tilt +=
        now.estimate.R_GI.row(2).cross(now.truth.R_GI.row(2)).squaredNorm();
    AddDrift(now, &errors);
  }

  void Print() const {
    std::printf("%8s %8s %16s %12s %16s\n",
                "version",
                "images",
                "velocity [m/s]",
                "tilt [deg]",
                "drift [mm/s]");
    for (const auto& entry : errors_) {
      const Errors& e = entry.second;
      std::printf("%8lld %8d %16.4f %12.3f %16.2f\n",
                  static_cast<long long>(entry.first),
                  e.count,
                  std::sqrt(e.velocity / e.count),
                  std::sqrt(e.tilt / e.count) * 180 / M_PI,
                  1e3 / kStep_s * std::sqrt(e.drift / e.steps));
    }
  }

 private:
  struct At {
    std::int64_t t_ns = 0;
    std::int64_t version = 0;
    Pose estimate, truth;
  };

  // The displacement since kStep_s ago, in the frame of the IMU at that time.
  void AddDrift(const At& now, Errors* errors) {
    if (!recent_.empty() && recent_.back().version != now.version) {
      recent_.clear();
    }
    recent_.push_back(now);
    if (now.t_ns - recent_.front().t_ns < sb::Nanoseconds(kStep_s)) return;
    const At& before = recent_.front();
    const auto moved = [](const Pose& a, const Pose& b) {
      return Eigen::Vector3d(a.R_GI.transpose() * (b.p_GI - a.p_GI));
    };
    ++errors->steps;
    errors->drift +=
        (moved(before.estimate, now.estimate) - moved(before.truth, now.truth))
            .squaredNorm();
    recent_.pop_front();
  }

  const Truth& truth_;
  const std::int64_t true_offset_ns_;
  std::map<std::int64_t, Errors> errors_;
  std::deque<At> recent_;
};

void PrintDifference(const char* name,
                     const selfcal::Calibration& truth,
                     const selfcal::Calibration& used) {
  for (std::int32_t i = 0; i < truth.camera_count(); ++i) {
    const selfcal_camera a = truth.camera(i);
    const selfcal_camera b = used.camera(i);
    const double angle =
        sb::EigenOf(a.q_CI).angularDistance(sb::EigenOf(b.q_CI));
    std::printf(
        "%s: camera %d is off by %.3f, %.3f px (f), %.3f, %.3f px (c), %.3f "
        "ms, "
        "%.2f, %.2f, %.2f mm, %.3f deg\n",
        name,
        i,
        b.f[0] - a.f[0],
        b.f[1] - a.f[1],
        b.c[0] - a.c[0],
        b.c[1] - a.c[1],
        1e3 * (b.time_offset_s - a.time_offset_s),
        1e3 * (b.p_CI[0] - a.p_CI[0]),
        1e3 * (b.p_CI[1] - a.p_CI[1]),
        1e3 * (b.p_CI[2] - a.p_CI[2]),
        angle * 180 / M_PI);
  }
  const selfcal_imu a = truth.imu();
  const selfcal_imu b = used.imu();
  std::printf(
      "%s: accelerometer is off by %.2f, %.2f, %.2f per mille, gyroscope by "
      "%.2f, %.2f, %.2f per mille\n",
      name,
      1e3 * (b.accel_scale[0] - a.accel_scale[0]),
      1e3 * (b.accel_scale[1] - a.accel_scale[1]),
      1e3 * (b.accel_scale[2] - a.accel_scale[2]),
      1e3 * (b.gyro_scale[0] - a.gyro_scale[0]),
      1e3 * (b.gyro_scale[1] - a.gyro_scale[1]),
      1e3 * (b.gyro_scale[2] - a.gyro_scale[2]));
}

selfcal::Calibration FactoryCalibration(selfcal::ClientOptions client,
                                        const std::string& rig) {
  client.rig = rig;
  const selfcal::Watch watch(client);
  for (int i = 0; i < 1000; ++i) {
    const selfcal::Calibration newest = watch.Newest();
    if (newest) return newest;
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  throw std::runtime_error("the daemon has no calibration of rig " + rig);
}

sb::BasaltCalibration ReadCalibration(const std::string& path) {
  std::ifstream file(path);
  if (!file) throw std::runtime_error(path + " cannot be read");
  cereal::JSONInputArchive archive(file);
  sb::BasaltCalibration calibration;
  archive(calibration);
  return calibration;
}

void PrintViolations(const selfcal::Acknowledgement& ack) {
  for (const selfcal::Violation& violation : ack.violations) {
    std::fprintf(stderr,
                 "segment %lld: %s %s\n",
                 static_cast<long long>(ack.index),
                 violation.field.c_str(),
                 violation.message.c_str());
  }
}

struct Arguments {
  selfcal::ClientOptions client;
  std::string truth, folder, config, calibration;
  double seconds = 1e9;
  double pace = 1;
  double pause = 1e9;  // [s]
};

// Waits until another version than that of the adapter is active.
void WaitForVersion(const selfcal::Watch& watch, const sb::Adapter& adapter) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::minutes(20);
  while (watch.Newest().version() == adapter.version() &&
         std::chrono::steady_clock::now() < end) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
}

// Feeds images and readings in the order of their times. Returns false if a
// calibration could not be applied.
bool Feed(const Arguments& arguments,
          basalt::VioDataset* data,
          sb::Adapter* adapter) {
  const selfcal::Watch watch(arguments.client);
  const std::int64_t first_version = adapter->version();
  bool has_paused = false;
  auto started = std::chrono::steady_clock::now();
  const auto& gyro = data->get_gyro_data();
  const auto& accel = data->get_accel_data();
  const std::int64_t begin_ns = data->get_image_timestamps().front();
  std::size_t reading = 0;
  const auto feed_until = [&](std::int64_t t_ns) {
    for (; reading < gyro.size() && gyro[reading].timestamp_ns <= t_ns;
         ++reading) {
      sb::Reading next;
      next.t_ns = gyro[reading].timestamp_ns;
      next.gyro = gyro[reading].data;
      next.accel = accel[reading].data;
      adapter->AddReading(next);
    }
  };
  for (const std::int64_t t_ns : data->get_image_timestamps()) {
    const double at_s = 1e-9 * static_cast<double>(t_ns - begin_ns);
    if (at_s > arguments.seconds) break;
    if (at_s > arguments.pause && !has_paused) {
      const auto begun = std::chrono::steady_clock::now();
      if (adapter->version() == first_version) WaitForVersion(watch, *adapter);
      started += std::chrono::steady_clock::now() - begun;
      has_paused = true;
    }
    std::this_thread::sleep_until(
        started + std::chrono::duration_cast<std::chrono::nanoseconds>(
                      std::chrono::duration<double>(arguments.pace * at_s)));
    sb::Images images;
    images.t_ns = t_ns;
    images.img_data = data->get_image_data(t_ns);
    feed_until(t_ns);
    if (adapter->AddImages(images)) {
      std::printf("version %lld is applied after %.1f s\n",
                  static_cast<long long>(adapter->version()),
                  at_s);
      std::fflush(stdout);
    } else if (!adapter->problem().empty()) {
      std::fprintf(stderr, "%s\n", adapter->problem().c_str());
      return false;
    }
  }
  feed_until(std::numeric_limits<std::int64_t>::max());
  return true;
}

int Run(const Arguments& arguments) {
  basalt::VioConfig config;
  config.load(arguments.config);
  basalt::EurocIO reader(/*load_mocap_as_gt=*/false);
  reader.read(arguments.folder);
  const basalt::VioDatasetPtr data = reader.get_data();
  if (data->get_image_timestamps().empty()) {
    throw std::runtime_error(arguments.folder + " has no images");
  }
  const selfcal::Calibration true_calibration =
      FactoryCalibration(arguments.client, arguments.truth);
  const Truth truth(*data);
  Comparison comparison(truth, true_calibration.camera(0).time_offset_s);

  sb::Options options;
  options.session =
      "basalt-" +
      std::to_string(
          std::chrono::system_clock::now().time_since_epoch().count());
  sb::Adapter* running = nullptr;
  options.on_output = [&](const sb::Output&) {
    if (!running->healthy()) return;
    const double offset_s = running->calibration().camera(0).time_offset_s;
    comparison.Add(*running->state(),
                   running->state()->t_ns - sb::Nanoseconds(offset_s),
                   running->version());
  };
  sb::Adapter adapter(arguments.client,
                      options,
                      config,
                      ReadCalibration(arguments.calibration),
                      PrintViolations);
  running = &adapter;
  if (!adapter.WaitForCalibration(std::chrono::seconds(10))) {
    std::fprintf(stderr, "%s\n", adapter.problem().c_str());
    return 1;
  }
  PrintDifference("at the start", true_calibration, adapter.calibration());
  if (!Feed(arguments, data.get(), &adapter)) return 1;
  const selfcal::Status end = adapter.Finish(std::chrono::seconds(60));
  if (!end.ok()) std::fprintf(stderr, "%s\n", end.message().c_str());
  PrintDifference("at the end", true_calibration, adapter.calibration());
  comparison.Print();
  const selfcal_stream_statistics sent = adapter.stream().statistics();
  std::printf(
      "segments: %llu stored, %llu rejected, %llu dropped; tracks: %llu "
      "triangulated, %llu dropped\n",
      static_cast<unsigned long long>(sent.stored),
      static_cast<unsigned long long>(sent.rejected),
      static_cast<unsigned long long>(sent.dropped),
      static_cast<unsigned long long>(sent.tracks_triangulated),
      static_cast<unsigned long long>(sent.tracks_dropped));
  return end.ok() && sent.rejected == 0 && sent.dropped == 0 ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 7 || argc > 10) {
    std::fprintf(stderr,
                 "usage: %s TARGET RIG TRUTH FOLDER CONFIG CALIBRATION "
                 "[SECONDS [PACE [PAUSE]]]\n",
                 argv[0]);
    return 2;
  }
  Arguments arguments;
  arguments.client.target = argv[1];
  arguments.client.rig = argv[2];
  arguments.truth = argv[3];
  arguments.folder = argv[4];
  arguments.config = argv[5];
  arguments.calibration = argv[6];
  if (argc > 7) arguments.seconds = std::atof(argv[7]);
  if (argc > 8) arguments.pace = std::atof(argv[8]);
  if (argc > 9) arguments.pause = std::atof(argv[9]);
  try {
    return Run(arguments);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 2;
  }
}
