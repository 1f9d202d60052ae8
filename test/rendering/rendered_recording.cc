#include "test/rendering/rendered_recording.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <utility>

namespace selfcal {
namespace {

constexpr int kRowIterations = 20;
constexpr double kRowTolerance_px = 1e-6;

SimulationOptions ImuOptions(const RenderOptions& options) {
  SimulationOptions simulation;
  simulation.seed = options.seed;
  simulation.imu_rate_hz = options.imu_rate_hz;
  return simulation;
}

// Stamps whose exposures all lie within the readings.
std::vector<std::int64_t> Stamps(const Rig& rig,
                                 const RenderOptions& options,
                                 double end_s) {
  double before_s = 0;
  double after_s = 0;
  for (const CameraCalibration& camera : rig.factory.cameras) {
    const double half_s = options.exposure_s / 2;
    const double rows_s = camera.line_delay_s.value_or(0) * camera.height_px;
    before_s = std::max(before_s, half_s - camera.time_offset_s);
    after_s = std::max(after_s, half_s + rows_s + camera.time_offset_s);
  }
  std::vector<std::int64_t> stamps_ns;
  for (int k = 0;; ++k) {
    const double t_s = before_s + k / options.image_rate_hz;
    if (t_s + after_s > end_s) return stamps_ns;
    stamps_ns.push_back(std::llround(t_s * 1e9));
  }
}

}  // namespace

RenderedRecording::RenderedRecording(
    const Rig& rig,
    std::unique_ptr<const Trajectory> trajectory,
    const RenderOptions& options)
    : rig_(rig),
      trajectory_(std::move(trajectory)),
      options_(options),
      scene_(MakeRoom(*trajectory_, options.scene, options.seed)),
      imu_(SimulateImu(
          rig, rig.factory.imu, *trajectory_, ImuOptions(options))) {
  if (rig.factory.imu1) {
    imu1_ = SimulateSecondImu(
        rig, *rig.factory.imu1, *trajectory_, ImuOptions(options));
  }
  for (const CameraCalibration& camera : rig_.factory.cameras) {
    renderers_.emplace_back(camera);
  }
  const double end_s = static_cast<double>(imu_.measured.back().t_ns) * 1e-9;
  stamps_ns_ = Stamps(rig_, options_, end_s);
}

GreyImage RenderedRecording::Image(int camera, int image) const {
  const auto j = static_cast<std::size_t>(camera);
  const double t_s = RowTime(camera, image, 0);
  std::vector<float> radiance;
  renderers_[j].Render(
      scene_, *trajectory_, t_s, options_.exposure_s, &radiance);
  return ReadOut(rig_.factory.cameras[j],
                 options_.sensor,
                 GainAt(options_.sensor, t_s),
                 {options_.seed, camera, image},
                 radiance);
}

double RenderedRecording::RowTime(int camera, int image, double row) const {
  const auto j = static_cast<std::size_t>(camera);
  return static_cast<double>(stamp_ns(image)) * 1e-9 +
         rig_.factory.cameras[j].time_offset_s +
         row * rig_.factory.cameras[j].line_delay_s.value_or(0);
}

std::optional<Hit> RenderedRecording::SurfaceAt(
    int camera, int image, const Eigen::Vector2d& z_px) const {
  const CameraCalibration& c =
      rig_.factory.cameras[static_cast<std::size_t>(camera)];
  Eigen::Vector3d bearing_C;
  if (!Unproject(c, z_px, &bearing_C)) return std::nullopt;
  const double t_s = RowTime(camera, image, z_px.y());
  const BodyMotion motion = trajectory_->At(t_s);
  const Eigen::Quaterniond q_GC = motion.q_GI * c.q_CI.conjugate();
  return Cast(scene_, motion.p_GI - q_GC * c.p_CI, q_GC * bearing_C, t_s);
}

bool RenderedRecording::TruePixel(int camera,
                                  int image,
                                  const Hit& hit,
                                  Eigen::Vector2d* z_px) const {
  const CameraCalibration& c =
      rig_.factory.cameras[static_cast<std::size_t>(camera)];
  double row = c.height_px / 2.0;
  // The row of the point decides when it is seen: a contraction, as points move
  // by far less than a row in the time of a row.
  for (int i = 0; i < kRowIterations; ++i) {
    const double t_s = RowTime(camera, image, row);
    const BodyMotion motion = trajectory_->At(t_s);
    const Eigen::Vector3d p_I =
        motion.q_GI.conjugate() * (PointAt(scene_, hit, t_s) - motion.p_GI);
    Eigen::Vector2d pixel;
    if (!Project(c, c.q_CI * p_I + c.p_CI, &pixel, nullptr)) return false;
    const double seen_row = std::clamp(pixel.y(), 0.0, c.height_px - 1.0);
    const double change_px = std::abs(seen_row - row);
    row = seen_row;
    if (!c.line_delay_s || change_px < kRowTolerance_px) {
      *z_px = pixel;
      return true;
    }
  }
  return false;
}

}  // namespace selfcal
