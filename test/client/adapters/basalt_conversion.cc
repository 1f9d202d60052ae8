// Compares what the adapter for Basalt makes of a calibration with two
// independent answers: the file that `selfcal calibration export --format
// basalt` has written, and the models of the client library.
//
//   basalt_conversion TARGET RIG FILE
//
// Readings are corrected and points projected by Basalt's code and by the
// library, at random states. Fails if they differ by more than rounding.
#include <basalt/serialization/headers_serialization.h>

#include <algorithm>
#include <cereal/archives/json.hpp>
#include <chrono>
#include <cstdio>
#include <fstream>
#include <random>
#include <thread>

#include "basalt_calibration.h"

namespace {

namespace sb = selfcal::basalt;

class RandomState {
 public:
  Eigen::Vector3d Vector(double sigma) {
    return sigma *
           Eigen::Vector3d(normal_(bits_), normal_(bits_), normal_(bits_));
  }

  selfcal::KeyframeState State() {
    selfcal::KeyframeState state = selfcal::KeyframeState();
    const Eigen::Vector3d turned = Vector(1);
    const double angle = turned.norm();
    state.q_GI = sb::QuaternionOf(
        Eigen::Quaterniond(Eigen::AngleAxisd(angle, turned / angle)));
    sb::Copy(Vector(1), state.p_GI);
    sb::Copy(Vector(1), state.v_GI);
    sb::Copy(Vector(0.1), state.b_a);
    sb::Copy(Vector(0.1), state.b_g);
    return state;
  }

 private:
  std::mt19937 bits_{1};
  std::normal_distribution<double> normal_;
};

double FileDifference(const sb::BasaltCalibration& a,
                      const sb::BasaltCalibration& b) {
  double most =
      std::max((a.calib_accel_bias.getParam() - b.calib_accel_bias.getParam())
                   .lpNorm<Eigen::Infinity>(),
               (a.calib_gyro_bias.getParam() - b.calib_gyro_bias.getParam())
                   .lpNorm<Eigen::Infinity>());
  if (a.cam_time_offset_ns != b.cam_time_offset_ns ||
      a.intrinsics.size() != b.intrinsics.size() ||
      a.resolution != b.resolution) {
    return 1;
  }
  for (std::size_t i = 0; i < a.intrinsics.size(); ++i) {
    if (a.intrinsics[i].getName() != b.intrinsics[i].getName()) return 1;
    most = std::max(
        {most,
         (a.T_i_c[i].inverse() * b.T_i_c[i]).log().lpNorm<Eigen::Infinity>(),
         (a.intrinsics[i].getParam() - b.intrinsics[i].getParam())
             .lpNorm<Eigen::Infinity>()});
  }
  return most;
}

// Difference of a pair of corrected readings, rotated to the world's frame.
double ReadingDifference(const selfcal::Calibration& theta,
                         const sb::BasaltCalibration& basalt,
                         const selfcal::KeyframeState& state,
                         RandomState* random) {
  const Eigen::Vector3d gyro = random->Vector(1);
  const Eigen::Vector3d accel = random->Vector(10);
  double g[3], a[3], w_I[3], f_I[3];
  sb::Copy(gyro, g);
  sb::Copy(accel, a);
  theta.CorrectImu(g, a, state.b_g, state.b_a, w_I, f_I);
  const sb::BasaltState body =
      sb::BasaltStateOf(state, sb::BodyFrameOf(theta.imu()));
  const Eigen::Vector3d w_B =
      basalt.calib_gyro_bias.getCalibrated(gyro) - body.bias_gyro;
  const Eigen::Vector3d f_B =
      basalt.calib_accel_bias.getCalibrated(accel) - body.bias_accel;
  const Eigen::Quaterniond q_GI = sb::EigenOf(state.q_GI);
  return std::max((body.T_w_i.so3() * w_B - q_GI * sb::VectorOf(w_I)).norm(),
                  (body.T_w_i.so3() * f_B - q_GI * sb::VectorOf(f_I)).norm());
}

// Difference of the pixels of a point in front of a camera, within 60 degrees
// of its axis.
double PixelDifference(const selfcal::Calibration& theta,
                       const sb::BasaltCalibration& basalt,
                       const selfcal::KeyframeState& state,
                       std::int32_t i,
                       RandomState* random) {
  const selfcal_camera camera = theta.camera(i);
  Eigen::Vector3d p_C = random->Vector(1);
  p_C.z() = 0.5 * p_C.head<2>().norm() + std::abs(p_C.z());
  if (std::string(camera.model).find("radial") == 0) p_C.head<2>() /= 2;
  const Eigen::Vector3d p_I =
      sb::EigenOf(camera.q_CI).conjugate() * (p_C - sb::VectorOf(camera.p_CI));
  const Eigen::Vector3d p_G =
      sb::EigenOf(state.q_GI) * p_I + sb::VectorOf(state.p_GI);
  double p[3], z_px[2];
  sb::Copy(p_C, p);
  if (!theta.Project(i, p, z_px)) return 1;
  const sb::BasaltState body =
      sb::BasaltStateOf(state, sb::BodyFrameOf(theta.imu()));
  const std::size_t j = static_cast<std::size_t>(i);
  Eigen::Vector4d in_camera;
  in_camera << (body.T_w_i * basalt.T_i_c[j]).inverse() * p_G, 0;
  Eigen::Vector2d pixel;
  if (!basalt.intrinsics[j].project(in_camera, pixel)) return 1;
  return (pixel - Eigen::Vector2d(z_px[0], z_px[1])).norm();
}

// Difference of a state that was converted and converted back.
double StateDifference(const selfcal::Calibration& theta,
                       const selfcal::KeyframeState& state) {
  const sb::BodyFrame frame = sb::BodyFrameOf(theta.imu());
  const selfcal::KeyframeState back =
      sb::StateOf(sb::BasaltStateOf(state, frame), frame);
  return std::max(
      {sb::EigenOf(back.q_GI).angularDistance(sb::EigenOf(state.q_GI)),
       (sb::VectorOf(back.p_GI) - sb::VectorOf(state.p_GI)).norm(),
       (sb::VectorOf(back.v_GI) - sb::VectorOf(state.v_GI)).norm(),
       (sb::VectorOf(back.b_g) - sb::VectorOf(state.b_g)).norm(),
       (sb::VectorOf(back.b_a) - sb::VectorOf(state.b_a)).norm()});
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 4) return 2;
  selfcal::ClientOptions client;
  client.target = argv[1];
  client.rig = argv[2];
  const selfcal::Watch watch(client);
  for (int i = 0; i < 1000 && !watch.Newest(); ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  const selfcal::Calibration theta = watch.Newest();
  if (!theta) return 2;
  sb::BasaltCalibration file;
  {
    std::ifstream stream(argv[3]);
    cereal::JSONInputArchive archive(stream);
    archive(file);
  }
  const std::string problem = sb::NotExpressible(theta, file.intrinsics.size());
  if (!problem.empty()) {
    std::fprintf(stderr, "%s\n", problem.c_str());
    return 1;
  }
  const sb::BasaltCalibration made = sb::BasaltCalibrationOf(theta, file);
  const double files = FileDifference(made, file);
  double readings = 0, pixels = 0, states = 0;
  RandomState random;
  for (int i = 0; i < 1000; ++i) {
    const selfcal::KeyframeState state = random.State();
    readings =
        std::max(readings, ReadingDifference(theta, made, state, &random));
    states = std::max(states, StateDifference(theta, state));
    for (std::int32_t j = 0; j < theta.camera_count(); ++j) {
      pixels =
          std::max(pixels, PixelDifference(theta, made, state, j, &random));
    }
  }
  std::printf("%s: file %.1e, readings %.1e, states %.1e, pixels %.1e\n",
              argv[2],
              files,
              readings,
              states,
              pixels);
  return files < 1e-12 && readings < 1e-11 && states < 1e-11 && pixels < 1e-8
             ? 0
             : 1;
}
