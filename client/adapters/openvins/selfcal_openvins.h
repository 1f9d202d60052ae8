// Connects OpenVINS to selfcald: it streams the filter's keyframes, tracks and
// IMU readings as motion segments, and applies each calibration that becomes
// active to the running filter.
//
// Licence: This file includes headers of OpenVINS, which is under the GNU
// General Public License, version 3 or later. A program that is built from it
// is a work combined with OpenVINS: whoever gives such a program to others does
// so under the terms of that licence. This file itself is GPL-3.0-or-later.
// Nothing of it is part of selfcal's packages and libraries, which are
// Apache-2.0.
//
// Requirements: OpenVINS is built without changes, with `imu_model: "rpng"`,
// whose matrices and frame are those of selfcal (the IMU's frame is the
// gyroscope's), without `downsample_cameras`, and with cameras that take their
// images together. The rig must have cameras of the models radial-tangential or
// equidistant and one time offset for all.
//
// Online calibration: With all calib_* switched off, the filter's calibration
// is what this class applies. With one of them on, the filter calibrates
// itself: nothing is applied, and segments carry its own values.
//
//   selfcal::openvins::Adapter adapter(client, options);
//   ov_msckf::VioManager vio(params);
//   adapter.WaitForCalibration(std::chrono::seconds(5), &vio);
//   for each reading:   vio.feed_measurement_imu(reading);
//                       adapter.AddReading(reading);
//   for each image(s):  vio.feed_measurement_camera(images);
//                       adapter.AddImages(images.timestamp, images.sensor_ids,
//                                         &vio);
//
// Threads: AddReading may be called from another thread than the rest, which
// belongs to the thread that feeds the images.
#pragma once

#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <selfcal/selfcal.hpp>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "core/VioManager.h"
#include "core/VioManagerOptions.h"
#include "feat/Feature.h"
#include "feat/FeatureDatabase.h"
#include "state/Propagator.h"
#include "state/State.h"
#include "state/StateHelper.h"
#include "track/TrackBase.h"
#include "utils/quat_ops.h"
#include "utils/sensor_data.h"

namespace selfcal {
namespace openvins {

struct Options {
  // Name of this run of the filter; a new one for each start of the process.
  std::string session;
  double keyframe_rate_hz = 10;
  double gravity_mps2 = 9.81;  // gravity_mag of the filter
  double pixel_sigma_px = 1;   // of a tracked point
  // The filter is not to be trusted beyond these: its segments are dropped.
  double max_speed_mps = 20;
  double max_gyro_bias_rps = 0.5;
  double max_accel_bias_mps2 = 3;
  double max_velocity_sigma_mps = 0.5;
};

inline std::int64_t Nanoseconds(double seconds) {
  return std::llround(1e9 * seconds);
}

template <typename Vector>
void Copy(const Vector& from, double* to) {
  for (Eigen::Index i = 0; i < from.size(); ++i) to[i] = from[i];
}

// The tracks of the filter, which only its subclasses see.
class Tracker : private ov_msckf::VioManager {
 public:
  static std::shared_ptr<ov_core::TrackBase> Of(
      const ov_msckf::VioManager& vio) {
    return vio.*(&Tracker::trackFEATS);
  }
};

// Quaternions of OpenVINS have the order x y z w and JPL's convention: its
// q_GtoI has the same numbers as the Hamilton quaternion q_GI, which rotates
// the other way.
inline Quaternion SameNumbers(const Eigen::Vector4d& q) {
  return {q[3], q[0], q[1], q[2]};
}
inline Eigen::Vector4d SameNumbers(const Quaternion& q) {
  return Eigen::Vector4d(q.x, q.y, q.z, q.w);
}

// Inverse of an upper triangle: of the matrix that distorts readings, or of
// OpenVINS's that corrects them.
inline Eigen::Matrix3d InverseTriangle(const Eigen::Matrix3d& matrix) {
  return matrix.triangularView<Eigen::Upper>().solve(
      Eigen::Matrix3d::Identity());
}

inline Eigen::Matrix3d Triangle(const double (&scale)[3],
                                const double (&misalignment)[3]) {
  Eigen::Matrix3d matrix;
  matrix << scale[0], misalignment[0], misalignment[1], 0, scale[1],
      misalignment[2], 0, 0, scale[2];
  return matrix;
}

// The six numbers of OpenVINS's "rpng" model, column by column.
inline Eigen::VectorXd TriangleNumbers(const Eigen::Matrix3d& matrix) {
  Eigen::VectorXd numbers(6);
  numbers << matrix(0, 0), matrix(0, 1), matrix(1, 1), matrix(0, 2),
      matrix(1, 2), matrix(2, 2);
  return numbers;
}

// The calibration that the filter uses now.
inline Calibration CalibrationOf(const ov_msckf::State& state) {
  const auto model = state._options.imu_model;
  const auto scales_of = [&](const Eigen::MatrixXd& numbers,
                             double(&scale)[3],
                             double(&misalignment)[3]) {
    const Eigen::Matrix3d matrix =
        InverseTriangle(ov_msckf::State::Dm(model, numbers));
    for (int i = 0; i < 3; ++i) scale[i] = matrix(i, i);
    misalignment[0] = matrix(0, 1);
    misalignment[1] = matrix(0, 2);
    misalignment[2] = matrix(1, 2);
  };
  selfcal_imu imu = selfcal_imu();
  scales_of(
      state._calib_imu_dw->value(), imu.gyro_scale, imu.gyro_misalignment);
  scales_of(
      state._calib_imu_da->value(), imu.accel_scale, imu.accel_misalignment);
  imu.q_AI = SameNumbers(Eigen::Vector4d(state._calib_imu_ACCtoIMU->value()));
  const Eigen::Matrix3d sensitivity =
      ov_msckf::State::Tg(state._calib_imu_tg->value());
  if (!sensitivity.isZero(0)) {
    imu.gyro_g_sensitivity_size = 9;
    for (int i = 0; i < 9; ++i) {
      imu.gyro_g_sensitivity[i] = sensitivity(i / 3, i % 3);
    }
  }
  std::vector<selfcal_camera> cameras;
  for (int i = 0; i < state._options.num_cameras; ++i) {
    selfcal_camera camera = selfcal_camera();
    const auto& lens = state._cam_intrinsics_cameras.at(i);
    const bool fisheye =
        std::dynamic_pointer_cast<ov_core::CamEqui>(lens) != nullptr;
    camera.model = fisheye ? "equidistant" : "radial-tangential";
    camera.width_px = lens->w();
    camera.height_px = lens->h();
    const Eigen::VectorXd values = state._cam_intrinsics.at(i)->value();
    Copy(values.head<2>(), camera.f);
    Copy(values.segment<2>(2), camera.c);
    camera.distortion_size = 4;
    Copy(values.tail<4>(), camera.distortion);
    const auto& pose = state._calib_IMUtoCAM.at(i);
    const Quaternion q_IC = SameNumbers(Eigen::Vector4d(pose->quat()));
    camera.q_CI = Quaternion{q_IC.w, -q_IC.x, -q_IC.y, -q_IC.z};
    Copy(pose->pos(), camera.p_CI);
    camera.time_offset_s = state._calib_dt_CAMtoIMU->value()(0);
    cameras.push_back(camera);
  }
  return Calibration(imu, cameras);
}

// Empty, or what of the calibration asks more of each segment than this adapter
// sends: without it, the daemon would refuse all of them.
inline std::string NotSent(const Calibration& calibration) {
  for (const selfcal_component& component : calibration.components()) {
    const std::string name = component.name;
    if (name.rfind("imu1.", 0) == 0) {
      return "the rig has a second IMU, whose readings the adapter does not "
             "send";
    }
    if (name.find("_slope") != std::string::npos) {
      return "the calibration depends on the temperature, which the adapter "
             "does not send (" +
             name + ")";
    }
  }
  return "";
}

// Empty, or what of the calibration the filter cannot use.
inline std::string NotExpressible(const Calibration& calibration,
                                  const ov_msckf::State& state) {
  if (state._options.imu_model != ov_msckf::StateOptions::ImuModel::RPNG) {
    return "imu_model is not rpng";
  }
  if (calibration.imu().accel_position_size > 0) {
    return "OpenVINS has no position of the accelerometer";
  }
  const std::string not_sent = NotSent(calibration);
  if (!not_sent.empty()) return not_sent;
  if (calibration.camera_count() != state._options.num_cameras) {
    return "the rig has another number of cameras";
  }
  const double time_offset_s = calibration.camera(0).time_offset_s;
  for (std::int32_t i = 0; i < calibration.camera_count(); ++i) {
    const selfcal_camera camera = calibration.camera(i);
    const std::string name = "camera " + std::to_string(i);
    const auto& lens = state._cam_intrinsics_cameras.at(i);
    const bool fisheye =
        std::dynamic_pointer_cast<ov_core::CamEqui>(lens) != nullptr;
    if (camera.model !=
        std::string(fisheye ? "equidistant" : "radial-tangential")) {
      return name + " is of the model " + camera.model;
    }
    if (camera.width_px != lens->w() || camera.height_px != lens->h()) {
      return name + " has images of another size";
    }
    if (camera.rolling_shutter != 0) {
      return name + " has a rolling shutter";
    }
    if (camera.clock_drifts != 0) return name + " has a clock that drifts";
    if (std::abs(camera.time_offset_s - time_offset_s) > 1e-4) {
      return name + " has another time offset than camera 0";
    }
  }
  return "";
}

template <typename Variable>
void Set(const Eigen::MatrixXd& value, Variable* variable) {
  variable->set_value(value);
  variable->set_fej(value);
}

// Replaces the filter's calibration. Its biases are moved so that a reading at
// rest means the same as before, as the bias has taken up what the calibration
// got wrong, and are less certain afterwards by as much.
inline void Apply(const Calibration& calibration, ov_msckf::VioManager* vio) {
  const std::shared_ptr<ov_msckf::State> state = vio->get_state();
  const std::shared_ptr<ov_core::TrackBase> tracker = Tracker::Of(*vio);
  const std::lock_guard<std::mutex> lock(state->_mutex_state);
  const Calibration before = CalibrationOf(*state);

  const selfcal_imu imu = calibration.imu();
  Set(TriangleNumbers(
          InverseTriangle(Triangle(imu.gyro_scale, imu.gyro_misalignment))),
      state->_calib_imu_dw.get());
  Set(TriangleNumbers(
          InverseTriangle(Triangle(imu.accel_scale, imu.accel_misalignment))),
      state->_calib_imu_da.get());
  Set(SameNumbers(imu.q_AI), state->_calib_imu_ACCtoIMU.get());
  Eigen::VectorXd sensitivity = Eigen::VectorXd::Zero(9);
  for (int i = 0; i < imu.gyro_g_sensitivity_size; ++i) {
    sensitivity[3 * (i % 3) + i / 3] = imu.gyro_g_sensitivity[i];
  }
  Set(sensitivity, state->_calib_imu_tg.get());
  for (std::int32_t i = 0; i < calibration.camera_count(); ++i) {
    const selfcal_camera camera = calibration.camera(i);
    Eigen::VectorXd values(8);
    values << camera.f[0], camera.f[1], camera.c[0], camera.c[1],
        camera.distortion[0], camera.distortion[1], camera.distortion[2],
        camera.distortion[3];
    Set(values, state->_cam_intrinsics.at(i).get());
    state->_cam_intrinsics_cameras.at(i)->set_value(values);
    Eigen::VectorXd pose(7);
    pose << -camera.q_CI.x, -camera.q_CI.y, -camera.q_CI.z, camera.q_CI.w,
        camera.p_CI[0], camera.p_CI[1], camera.p_CI[2];
    Set(pose, state->_calib_IMUtoCAM.at(i).get());
  }
  Set(Eigen::VectorXd::Constant(1, calibration.camera(0).time_offset_s),
      state->_calib_dt_CAMtoIMU.get());

  // Rays of earlier images, which the filter keeps.
  for (const auto& entry :
       tracker->get_feature_database()->get_internal_data()) {
    ov_core::Feature& feature = *entry.second;
    for (auto& camera : feature.uvs) {
      const auto& lens = state->_cam_intrinsics_cameras.at(camera.first);
      auto& rays = feature.uvs_norm.at(camera.first);
      for (std::size_t i = 0; i < rays.size(); ++i) {
        rays[i] = lens->undistort_f(camera.second[i].head<2>());
      }
    }
  }

  if (!vio->initialized()) return;
  const Eigen::Vector3d rest =
      state->_imu->Rot() * Eigen::Vector3d(0, 0, vio->get_params().gravity_mag);
  double f_I[3], b_g[3], b_a[3];
  Copy(rest, f_I);
  Copy(state->_imu->bias_g(), b_g);
  Copy(state->_imu->bias_a(), b_a);
  calibration.CarryBiases(before, f_I, b_g, b_a);
  Eigen::MatrixXd value = state->_imu->value();
  value.block<3, 1>(10, 0) = Eigen::Map<const Eigen::Vector3d>(b_g);
  value.block<3, 1>(13, 0) = Eigen::Map<const Eigen::Vector3d>(b_a);
  const Eigen::VectorXd moved = value - state->_imu->value();
  const Eigen::MatrixXd added =
      (Eigen::VectorXd(15) << Eigen::VectorXd::Zero(9), moved.tail<6>())
          .finished()
          .cwiseAbs2()
          .asDiagonal();
  Set(value, state->_imu.get());
  ov_msckf::StateHelper::EKFPropagation(state,
                                        {state->_imu},
                                        {state->_imu},
                                        Eigen::MatrixXd::Identity(15, 15),
                                        added);
  vio->get_propagator()->invalidate_cache();
}

class Adapter {
 public:
  // Throws selfcal::Error for invalid options.
  Adapter(const ClientOptions& client,
          const Options& options,
          Stream::AckCallback on_ack = Stream::AckCallback())
      : options_(options),
        builder_(BuilderOptionsOf(options)),
        stream_(client, std::move(on_ack)),
        watch_(client) {}

  // Waits for the active calibration and applies it; call it before the first
  // image. Returns false if the daemon has not answered in time, or if the
  // filter cannot use the calibration (problem()): it goes on with its own.
  bool WaitForCalibration(std::chrono::milliseconds timeout,
                          ov_msckf::VioManager* vio) {
    const auto end = std::chrono::steady_clock::now() + timeout;
    while (!watch_.Newest() && std::chrono::steady_clock::now() < end) {
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    return ApplyNewest(vio);
  }

  // Call it with every reading, after the filter.
  void AddReading(const ov_core::ImuData& reading) {
    ImuSample sample;
    sample.t_ns = Nanoseconds(reading.timestamp);
    Copy(reading.wm, sample.gyro);
    Copy(reading.am, sample.accel);
    const std::lock_guard<std::mutex> lock(mutex_);
    builder_.AddImu(sample);
    SendComplete();
  }

  // Call it after the filter has processed images. Returns true if it has
  // applied a calibration since the last call.
  bool AddImages(double timestamp,
                 const std::vector<int>& cameras,
                 ov_msckf::VioManager* vio) {
    const std::shared_ptr<ov_msckf::State> state = vio->get_state();
    const bool healthy = IsHealthy(timestamp, vio);
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      builder_.SetHealthy(healthy);
      if (healthy && IsKeyframe(timestamp)) {
        AddKeyframe(timestamp, cameras, vio);
        SendComplete();
      }
    }
    return watch_.Newest().version() != version_ && ApplyNewest(vio);
  }

  // Ends the last segment and waits until the daemon has all of them.
  Status Finish(std::chrono::milliseconds timeout) {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      builder_.Flush(10);
      SendComplete();
    }
    return stream_.Drain(timeout);
  }

  // Version that the filter estimates with; 0 before the first.
  std::int64_t version() const { return version_; }
  // Empty, or why the newest calibration was not applied.
  const std::string& problem() const { return problem_; }
  const Stream& stream() const { return stream_; }
  selfcal_builder_statistics statistics() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return builder_.statistics();
  }

 private:
  static BuilderOptions BuilderOptionsOf(const Options& options) {
    BuilderOptions session;
    session.session = options.session;
    session.gravity_mps2 = options.gravity_mps2;
    session.pixel_sigma_px = options.pixel_sigma_px;
    return session;
  }

  static bool CalibratesItself(const ov_msckf::StateOptions& options) {
    return options.do_calib_camera_pose || options.do_calib_camera_intrinsics ||
           options.do_calib_camera_timeoffset ||
           options.do_calib_imu_intrinsics ||
           options.do_calib_imu_g_sensitivity;
  }

  bool ApplyNewest(ov_msckf::VioManager* vio) {
    const Calibration newest = watch_.Newest();
    if (!newest) {
      problem_ = "the daemon has not answered";
      return false;
    }
    const std::shared_ptr<ov_msckf::State> state = vio->get_state();
    if (CalibratesItself(state->_options)) {
      // The version that it began with stays that of its segments.
      if (version_ == 0) SetVersion(newest.version());
      problem_ = "the filter calibrates itself";
      return false;
    }
    problem_ = NotExpressible(newest, *state);
    if (!problem_.empty()) return false;
    Apply(newest, vio);
    SetVersion(newest.version());
    return true;
  }

  void SetVersion(std::int64_t version) {
    version_ = version;
    const std::lock_guard<std::mutex> lock(mutex_);
    builder_.SetCalibrationVersion(version);
  }

  bool IsHealthy(double timestamp, ov_msckf::VioManager* vio) const {
    const std::shared_ptr<ov_msckf::State> state = vio->get_state();
    if (!vio->initialized() || state->_timestamp != timestamp) return false;
    const ov_type::IMU& imu = *state->_imu;
    if (!imu.value().allFinite()) return false;
    const Eigen::MatrixXd covariance =
        ov_msckf::StateHelper::get_marginal_covariance(state,
                                                       {state->_imu->v()});
    const double sigma = std::sqrt(covariance.diagonal().maxCoeff());
    // Comparisons with NaN are false.
    return sigma <= options_.max_velocity_sigma_mps &&
           imu.vel().norm() <= options_.max_speed_mps &&
           imu.bias_g().norm() <= options_.max_gyro_bias_rps &&
           imu.bias_a().norm() <= options_.max_accel_bias_mps2;
  }

  // Images are nearly periodic: a quarter of the interval is left for jitter.
  bool IsKeyframe(double timestamp) {
    if (timestamp - last_keyframe_s_ < 0.75 / options_.keyframe_rate_hz) {
      return false;
    }
    last_keyframe_s_ = timestamp;
    return true;
  }

  void AddKeyframe(double timestamp,
                   const std::vector<int>& cameras,
                   ov_msckf::VioManager* vio) {
    const std::shared_ptr<ov_msckf::State> state = vio->get_state();
    const ov_type::IMU& imu = *state->_imu;
    KeyframeState at;
    at.t_ns = Nanoseconds(timestamp + state->_calib_dt_CAMtoIMU->value()(0));
    at.q_GI = SameNumbers(Eigen::Vector4d(imu.quat()));
    Copy(imu.pos(), at.p_GI);
    Copy(imu.vel(), at.v_GI);
    Copy(imu.bias_a(), at.b_a);
    Copy(imu.bias_g(), at.b_g);

    std::vector<Observation> seen;
    const auto tracker = Tracker::Of(*vio);
    const auto pixels = tracker->get_last_obs();
    const auto ids = tracker->get_last_ids();
    for (const int camera : cameras) {
      const auto points = pixels.find(camera);
      const auto names = ids.find(camera);
      if (points == pixels.end() || names == ids.end()) continue;
      for (std::size_t i = 0; i < points->second.size(); ++i) {
        const cv::Point2f& pixel = points->second[i].pt;
        seen.push_back(
            ObservationOfTrack(names->second[i], camera, pixel.x, pixel.y));
      }
    }
    builder_.SetTheta(CalibrationOf(*state));
    builder_.AddKeyframe(at, Nanoseconds(timestamp), seen);
  }

  void SendComplete() {
    while (Segment segment = builder_.Take()) stream_.Send(std::move(segment));
  }

  const Options options_;
  mutable std::mutex mutex_;  // guards builder_
  Builder builder_;
  Stream stream_;
  Watch watch_;
  std::int64_t version_ = 0;
  std::string problem_;
  double last_keyframe_s_ = -1e300;
};

}  // namespace openvins
}  // namespace selfcal
