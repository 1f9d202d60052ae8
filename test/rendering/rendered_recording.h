// A recording of a simulated device, with its truth: images of a room by every
// camera of a rig, and the readings of its IMUs.
//
// Images are made when they are asked for, so that a recording of any length
// needs no memory. Immutable; any thread may ask for images. The same rig,
// trajectory and options give the same bits.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "core/model/rig.h"
#include "core/simulation/imu_readings.h"
#include "core/simulation/trajectory.h"
#include "test/rendering/camera_renderer.h"
#include "test/rendering/scene.h"
#include "test/rendering/sensor.h"

namespace selfcal {

struct RenderOptions {
  std::uint64_t seed = 1;
  double image_rate_hz = 20;
  double imu_rate_hz = 200;
  double exposure_s = 0;  // of every row
  SceneOptions scene;
  SensorOptions sensor;
};

class RenderedRecording {
 public:
  // rig.factory is the truth. The trajectory must last longer than the time
  // offsets and the exposures.
  RenderedRecording(const Rig& rig,
                    std::unique_ptr<const Trajectory> trajectory,
                    const RenderOptions& options);

  const Rig& rig() const { return rig_; }
  const Scene& scene() const { return scene_; }
  const Trajectory& trajectory() const { return *trajectory_; }
  const RenderOptions& options() const { return options_; }
  const ImuReadings& imu() const { return imu_; }
  // Readings of the second IMU, if the rig has one.
  const std::optional<ImuReadings>& imu1() const { return imu1_; }
  int cameras() const { return static_cast<int>(rig_.factory.cameras.size()); }
  int images() const { return static_cast<int>(stamps_ns_.size()); }

  // Timestamps are the same for all cameras, relative to the start of the
  // trajectory. An image with the stamp t has its row v exposed about
  // t + time_offset_s + v line_delay_s on the clock of the IMU.
  std::int64_t stamp_ns(int image) const {
    return stamps_ns_[static_cast<std::size_t>(image)];
  }
  GreyImage Image(int camera, int image) const;

  // The middle of the exposure of a row, on the clock of the IMU.
  double RowTime(int camera, int image, double row) const;

  // What the camera sees at a pixel; nothing for a pixel without a ray.
  std::optional<Hit> SurfaceAt(int camera,
                               int image,
                               const Eigen::Vector2d& z_px) const;

  // The true pixel of the point of a hit, also if it is hidden. False outside
  // the region of the camera model, or if no row sees it.
  bool TruePixel(int camera,
                 int image,
                 const Hit& hit,
                 Eigen::Vector2d* z_px) const;

 private:
  Rig rig_;
  std::unique_ptr<const Trajectory> trajectory_;
  RenderOptions options_;
  Scene scene_;
  ImuReadings imu_;
  std::optional<ImuReadings> imu1_;
  std::vector<CameraRenderer> renderers_;
  std::vector<std::int64_t> stamps_ns_;
};

}  // namespace selfcal
