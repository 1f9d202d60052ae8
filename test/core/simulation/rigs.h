// Rigs and truth for the tests of the simulation.
#pragma once

#include <algorithm>
#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/model/camera_model.h"
#include "core/model/so3.h"
#include "core/simulation/simulate.h"

namespace selfcal {

// Two cameras side by side with the two other distortion models.
inline Rig StereoRig() {
  Rig rig = HandheldRig("stereo");
  CameraCalibration left = rig.factory.cameras[0];
  left.f = {460, 458};
  left.c = {367, 249};
  left.width_px = 752;
  left.height_px = 480;
  left.model = DistortionModel::kRadialTangential;
  left.distortion = Eigen::Vector4d(-0.28, 0.07, 2e-4, 2e-5);
  CameraCalibration right = left;
  right.q_CI = Exp({0.01, -0.02, 0.005}) * left.q_CI;
  right.p_CI.x() -= 0.11;
  right.f = {275, 276};
  right.c = {359, 270};
  right.width_px = 720;
  right.height_px = 540;
  right.model = DistortionModel::kEquidistant;
  right.distortion = Eigen::Vector4d(0.01, -0.005, 0.002, -0.0004);
  rig.factory.cameras = {left, right};
  return rig;
}

// One to four cameras of all models: two that look ahead, 11 cm apart and with
// much in common, then one to the left and one to the right.
inline Rig RigOfCameras(int cameras) {
  Rig rig = HandheldRig("cameras-" + std::to_string(cameras));
  const CameraCalibration first = rig.factory.cameras[0];
  const CameraCalibration beside = StereoRig().factory.cameras[1];
  CameraCalibration left = StereoRig().factory.cameras[0];
  left.q_CI = left.q_CI * Exp({0, 0, -1.4});
  left.p_CI = {0.01, 0.02, -0.04};
  CameraCalibration right = first;
  right.q_CI = Exp({-0.01, 0.02, 0}) * first.q_CI * Exp({0, 0, 1.3});
  right.p_CI = {-0.02, 0.03, -0.05};
  right.f = {261, 262};
  right.distortion[0] = 0.88;
  rig.factory.cameras = {first, beside, left, right};
  rig.factory.cameras.resize(cameras);
  return rig;
}

// Coefficients of a lens of each model, which is one-to-one over the whole
// image of LensRig; in the middle of the usual values for a model that is not
// here.
inline DistortionVector LensOf(DistortionModel model) {
  const std::map<std::string_view, std::vector<double>> lenses = {
      {"fov", {0.92}},
      {"radial-tangential", {-0.28, 0.07, 2e-4, 2e-5}},
      {"equidistant", {0.0035, 0.0007, -0.002, 0.0002}},
      {"radial-tangential-5", {-0.28, 0.09, 2e-4, 2e-5, -0.005}},
      {"radial-tangential-8", {0.5, 0.1, 2e-4, 2e-5, 0.005, 0.8, 0.2, 0.01}},
      {"unified", {1.2, -0.05, 0.01, 2e-4, 2e-5}},
      {"extended-unified", {0.6, 1.1}},
      {"double-sphere", {-0.18, 0.59}}};
  DistortionVector k(DistortionSize(model));
  for (int i = 0; i < k.size(); ++i) {
    const Interval usual = ModelInfo(model).coefficients[i].usual;
    k[i] = (usual.low + usual.high) / 2;
  }
  const auto lens = lenses.find(DistortionName(model));
  if (lens != lenses.end()) std::copy_n(lens->second.begin(), k.size(), &k[0]);
  return k;
}

// One camera of a model, of 640 x 640 px. A model that is not a pinhole has a
// fish-eye, whose image shows rays beyond 90 degrees.
inline Rig LensRig(DistortionModel model) {
  Rig rig = HandheldRig("lens");
  CameraCalibration& camera = rig.factory.cameras[0];
  camera.model = model;
  camera.distortion = LensOf(model);
  camera.width_px = 640;
  camera.height_px = 640;
  camera.c = {318, 322};
  camera.f.setOnes();
  Eigen::Vector2d z_px;
  const bool beyond = Project(camera, {1, 0, -0.1}, &z_px, nullptr);
  camera.f = (beyond ? 180 : 400) / PixelsPerRadian(camera).array();
  return rig;
}

// Adds a second IMU and estimates every block that there is.
inline void EstimateEveryBlock(Rig* rig) {
  AddSecondImu(rig);
  rig->blocks = {{"*", true}};
  AddEstimatedBlocks(rig->blocks, &rig->factory);
  rig->groups = DefaultGroups(rig->blocks, rig->factory);
}

// A rig of one camera with another of the same kind 11 cm to its right, as SLAM
// systems for stereo need them.
inline Rig TwinRig(Rig rig) {
  CameraCalibration right = rig.factory.cameras.at(0);
  right.q_CI = Exp({0.005, -0.01, 0.003}) * right.q_CI;
  right.p_CI.x() -= 0.11;
  right.f *= 1.004;
  right.c += Eigen::Vector2d(4, -3);
  rig.factory.cameras = {rig.factory.cameras[0], right};
  return rig;
}

// The calibration of a start that is wrong by 5 % in f, 10 px in c, 3 degrees,
// 5 cm and 20 ms.
inline Calibration WrongStart(const Calibration& truth) {
  CalibrationError error;
  error.focal_relative = 0.05;
  error.principal_point_px = 10;
  error.camera_rotation_rad = 0.0524;
  error.camera_position_m = 0.05;
  Calibration start = PerturbCalibration(truth, error, 1);
  for (CameraCalibration& camera : start.cameras) {
    camera.time_offset_s += 0.02;
  }
  return start;
}

// Errors of the SLAM system all zero.
inline SimulationOptions PerfectSlam() {
  SimulationOptions options;
  options.slam_rotation_rad = 0;
  options.slam_position_m = 0;
  options.slam_velocity_mps = 0;
  options.slam_accel_bias_mps2 = 0;
  options.slam_gyro_bias_radps = 0;
  options.slam_landmark_relative = 0;
  return options;
}

// Single segments, each of its own motion and in a session of its own;
// change(i, &options) sets what differs in segment i.
template <typename Change>
std::vector<MotionSegment> SimulateSingly(const Rig& rig,
                                          const Calibration& truth,
                                          int count,
                                          const SimulationOptions& options,
                                          const Change& change) {
  const double segment_s =
      options.keyframes_per_segment / options.keyframe_rate_hz;
  std::vector<MotionSegment> segments;
  for (int i = 0; i < count; ++i) {
    SimulationOptions own = options;
    own.seed = 100 * options.seed + static_cast<std::uint64_t>(i);
    change(i, &own);
    segments.push_back(Simulate(rig,
                                truth,
                                rig.factory,
                                *MakeHandheld(segment_s + 0.5, 1, own.seed),
                                "apart-" + std::to_string(i),
                                own)
                           .segments.front());
  }
  return segments;
}

// Single segments with this much time from one to the next since their sessions
// began.
inline std::vector<MotionSegment> SimulateApart(
    const Rig& rig,
    const Calibration& truth,
    int count,
    double apart_s,
    const SimulationOptions& options) {
  return SimulateSingly(
      rig, truth, count, options, [&](int i, SimulationOptions* own) {
        own->session_age_s = i * apart_s;
      });
}

// Single segments at these temperatures.
inline std::vector<MotionSegment> SimulateAtTemperatures(
    const Rig& rig,
    const Calibration& truth,
    const std::vector<double>& temperatures_c,
    const SimulationOptions& options) {
  const int count = static_cast<int>(temperatures_c.size());
  return SimulateSingly(
      rig, truth, count, options, [&](int i, SimulationOptions* own) {
        own->temperature_c = temperatures_c[i];
      });
}

// Gives a device slopes of the size of low-cost parts: 0.02 % per kelvin of
// scales, 1e-4 of the focal length, 0.002 degrees between camera and IMU.
inline Calibration WithSlopes(Calibration theta) {
  theta.imu.s_g_slope = Eigen::Vector3d(2e-4, -1.5e-4, 1e-4);
  theta.imu.s_a_slope = Eigen::Vector3d(-2e-4, 1e-4, 2e-4);
  for (CameraCalibration& camera : theta.cameras) {
    camera.q_CI_slope = Eigen::Vector3d(3e-5, -2e-5, 4e-5);
    camera.f_slope = 1e-4 * camera.f;
  }
  return theta;
}

// The same, with slopes that are zero: what is to be estimated.
inline Calibration WithZeroSlopes(Calibration theta) {
  theta = WithSlopes(std::move(theta));
  theta.imu.s_g_slope.setZero();
  theta.imu.s_a_slope.setZero();
  for (CameraCalibration& camera : theta.cameras) {
    camera.q_CI_slope.setZero();
    camera.f_slope.setZero();
  }
  return theta;
}

// A device moved vigorously, whose SLAM system believes a perturbed
// calibration.
inline SimulatedSession SimulateHandheld(const Rig& rig,
                                         double duration_s,
                                         const SimulationOptions& options) {
  return Simulate(rig,
                  rig.factory,
                  PerturbCalibration(rig.factory, {}, options.seed),
                  *MakeHandheld(duration_s, 1, options.seed),
                  "session",
                  options);
}

}  // namespace selfcal
