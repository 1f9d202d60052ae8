#include "test/rendering/rendered_recording.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "test/core/simulation/rigs.h"

namespace selfcal {
namespace {

Rig SmallStereo() {
  Rig rig = StereoRig();
  for (CameraCalibration& camera : rig.factory.cameras) {
    camera.f /= 4;
    camera.c /= 4;
    camera.width_px /= 4;
    camera.height_px /= 4;
  }
  for (CameraCalibration& camera : rig.factory.cameras) {
    camera.line_delay_s = 100e-6;
  }
  rig.factory.cameras[0].time_offset_s = 0.012;
  rig.factory.cameras[1].time_offset_s = -0.03;
  return rig;
}

RenderOptions AllEffects() {
  RenderOptions options;
  options.seed = 5;
  options.exposure_s = 0.004;
  options.scene.moving_boxes = 3;
  options.sensor.gain_amplitude = 0.3;
  return options;
}

TEST(RenderedRecording, IsTheSameToTheBitForTheSameSeed) {
  const auto make = [](std::uint64_t seed) {
    RenderOptions options = AllEffects();
    options.seed = seed;
    return RenderedRecording(SmallStereo(), MakeHandheld(3, 1, 5), options);
  };
  const RenderedRecording a = make(5);
  const RenderedRecording b = make(5);
  const RenderedRecording other = make(6);
  ASSERT_GT(a.images(), 50);
  for (const int k : {0, 17, 50}) {
    for (int j = 0; j < 2; ++j) {
      EXPECT_EQ(a.Image(j, k).pixels, b.Image(j, k).pixels);
      EXPECT_NE(a.Image(j, k).pixels, other.Image(j, k).pixels);
    }
  }
  for (std::size_t i = 0; i < a.imu().measured.size(); ++i) {
    EXPECT_EQ(a.imu().measured[i].gyro, b.imu().measured[i].gyro);
  }
}

TEST(RenderedRecording, ExposesEveryRowWithinTheReadings) {
  const RenderedRecording recording(
      SmallStereo(), MakeHandheld(3, 1, 5), AllEffects());
  const double half_s = 0.002;
  for (int j = 0; j < 2; ++j) {
    EXPECT_GE(recording.RowTime(j, 0, 0) - half_s, -1e-9);
    EXPECT_LE(recording.RowTime(j, recording.images() - 1, 134) + half_s, 3);
  }
  EXPECT_NEAR(recording.RowTime(1, 4, 10),
              recording.stamp_ns(4) * 1e-9 - 0.03 + 10 * 100e-6,
              1e-12);
  EXPECT_NEAR(recording.stamp_ns(8) - recording.stamp_ns(7), 50'000'000, 1);
}

TEST(RenderedRecording, PointThatAPixelSeesHasThisPixel) {
  const RenderedRecording recording(
      SmallStereo(), MakeHandheld(3, 1, 5), AllEffects());
  int moving = 0;
  for (int k = 0; k < recording.images(); ++k) {
    for (int j = 0; j < 2; ++j) {
      const CameraCalibration& camera = recording.rig().factory.cameras[j];
      for (int v = 3; v < camera.height_px; v += 15) {
        for (int u = 3; u < camera.width_px; u += 15) {
          const auto hit = recording.SurfaceAt(j, k, {u, v});
          ASSERT_TRUE(hit);
          if (recording.scene().Surface(hit->surface).moves()) ++moving;
          Eigen::Vector2d z_px;
          ASSERT_TRUE(recording.TruePixel(j, k, *hit, &z_px));
          EXPECT_LT((z_px - Eigen::Vector2d(u, v)).norm(), 1e-4);
        }
      }
    }
  }
  EXPECT_GT(moving, 20);
}

TEST(RenderedRecording, SamePointLooksAlikeInTheNextImage) {
  // Greys at the true pixels of points, three images apart: they agree only if
  // the truth is that of the images.
  RenderOptions options = AllEffects();
  options.sensor.noise = false;
  options.sensor.vignetting = 0;
  options.sensor.gain_amplitude = 0;
  const RenderedRecording recording(
      HandheldRig("x"), MakeHandheld(3, 1, 5), options);
  const GreyImage first = recording.Image(0, 10);
  const GreyImage second = recording.Image(0, 13);
  const auto at = [](const GreyImage& image, const Eigen::Vector2d& z) {
    const auto u = static_cast<int>(z.x());
    const auto v = static_cast<int>(z.y());
    const double a = z.x() - u;
    const double b = z.y() - v;
    const std::uint8_t* p =
        image.pixels.data() + static_cast<std::size_t>(v) * image.width_px + u;
    return (1 - b) * ((1 - a) * p[0] + a * p[1]) +
           b * ((1 - a) * p[image.width_px] + a * p[image.width_px + 1]);
  };
  double moved = 0;
  double squares = 0;
  double shifted_squares = 0;
  int points = 0;
  for (int v = 40; v < 440; v += 9) {
    for (int u = 40; u < 600; u += 9) {
      const Eigen::Vector2d z(u, v);
      Eigen::Vector2d next;
      const auto hit = recording.SurfaceAt(0, 10, z);
      if (!hit || !recording.TruePixel(0, 13, *hit, &next)) continue;
      if (next.x() < 5 || next.y() < 5 || next.x() > 630 || next.y() > 470) {
        continue;
      }
      moved += (next - z).norm();
      squares += std::pow(at(first, z) - at(second, next), 2);
      const Eigen::Vector2d beside = next + Eigen::Vector2d(1, 1);
      shifted_squares += std::pow(at(first, z) - at(second, beside), 2);
      ++points;
    }
  }
  ASSERT_GT(points, 1000);
  EXPECT_GT(moved / points, 5);
  // A shift by a pixel and a half would already be seen.
  EXPECT_LT(squares, 0.5 * shifted_squares);
}

}  // namespace
}  // namespace selfcal
