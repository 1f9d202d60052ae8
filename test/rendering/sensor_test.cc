#include "test/rendering/sensor.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <vector>

#include "core/simulation/simulate.h"

namespace selfcal {
namespace {

CameraCalibration Camera() { return HandheldRig("x").factory.cameras[0]; }

std::vector<float> Flat(const CameraCalibration& camera, float value) {
  return std::vector<float>(
      static_cast<std::size_t>(camera.width_px) * camera.height_px, value);
}

SensorOptions EvenSensor() {
  SensorOptions options;
  options.vignetting = 0;
  return options;
}

struct Greys {
  double mean = 0;
  double variance = 0;
};
Greys GreysOf(const GreyImage& image) {
  Greys moments;
  for (const std::uint8_t grey : image.pixels) moments.mean += grey;
  moments.mean /= static_cast<double>(image.pixels.size());
  for (const std::uint8_t grey : image.pixels) {
    moments.variance += std::pow(grey - moments.mean, 2);
  }
  moments.variance /= static_cast<double>(image.pixels.size());
  return moments;
}

TEST(Sensor, NoiseHasTheVarianceOfElectronsAndOfReading) {
  const CameraCalibration camera = Camera();
  for (const double gain : {0.5, 1.0, 2.0}) {
    for (const float radiance : {0.1F, 0.4F}) {
      SensorOptions options = EvenSensor();
      options.full_well_e = 5000;
      options.read_noise_e = 15;
      const Greys moments = GreysOf(
          ReadOut(camera, options, gain, {1, 0, 3}, Flat(camera, radiance)));
      const double electrons = 5000.0 * radiance;
      const double grey_per_e = gain * 255 / 5000;
      // Rounding to whole numbers adds the variance of its interval.
      const double variance =
          (electrons + 15 * 15) * grey_per_e * grey_per_e + 1.0 / 12;
      EXPECT_NEAR(moments.mean, electrons * grey_per_e, 0.05);
      EXPECT_NEAR(moments.variance / variance, 1, 0.02);
    }
  }
}

TEST(Sensor, NoiseOfImagesCamerasAndSeedsIsIndependent) {
  const CameraCalibration camera = Camera();
  const SensorOptions options = EvenSensor();
  const std::vector<float> radiance = Flat(camera, 0.5F);
  const auto image = [&](const ImageSeed& seed) {
    return ReadOut(camera, options, 1, seed, radiance);
  };
  const GreyImage first = image({1, 0, 0});
  EXPECT_EQ(first.pixels, image({1, 0, 0}).pixels);
  const Greys moments = GreysOf(first);
  const auto correlation = [&](const GreyImage& other, std::size_t lag) {
    double sum = 0;
    for (std::size_t i = lag; i < first.pixels.size(); ++i) {
      sum += (first.pixels[i - lag] - moments.mean) *
             (other.pixels[i] - moments.mean);
    }
    return sum / (static_cast<double>(first.pixels.size()) * moments.variance);
  };
  // Five standard deviations of the correlation of independent pixels.
  const double limit = 5 / std::sqrt(640.0 * 480.0);
  EXPECT_LT(std::abs(correlation(image({1, 0, 1}), 0)), limit);
  EXPECT_LT(std::abs(correlation(image({1, 1, 0}), 0)), limit);
  EXPECT_LT(std::abs(correlation(image({2, 0, 0}), 0)), limit);
  for (const std::size_t lag : {1, 2, 5, 640}) {
    EXPECT_LT(std::abs(correlation(first, lag)), limit) << lag;
  }
}

TEST(Sensor, CornerIsDarkerByTheVignetting) {
  const CameraCalibration camera = Camera();
  SensorOptions options;
  options.vignetting = 0.4;
  options.noise = false;
  const GreyImage image = ReadOut(camera, options, 1, {}, Flat(camera, 0.8F));
  const auto at = [&](int u, int v) {
    return int{image.pixels[static_cast<std::size_t>(v) * 640 + u]};
  };
  EXPECT_EQ(at(318, 242), 204);  // the principal point
  // The farthest corner is (639, 0).
  EXPECT_EQ(at(639, 0), std::lround(204 * 0.6));
  // Half of the way to it.
  EXPECT_NEAR(at(478, 121), 204 * 0.9, 1);
  EXPECT_NEAR(Vignetting(camera, options, {639, 0}), 0.6, 1e-12);
}

TEST(Sensor, SaturatesAtWhite) {
  const CameraCalibration camera = Camera();
  SensorOptions options = EvenSensor();
  const GreyImage image = ReadOut(camera, options, 4, {}, Flat(camera, 0.9F));
  for (const std::uint8_t grey : image.pixels) ASSERT_EQ(grey, 255);
}

TEST(Sensor, GainSwingsByItsAmplitude) {
  SensorOptions options;
  options.gain_amplitude = std::numbers::ln2;
  options.gain_period_s = 4;
  EXPECT_NEAR(GainAt(options, 0), 1, 1e-12);
  EXPECT_NEAR(GainAt(options, 1), 2, 1e-12);
  EXPECT_NEAR(GainAt(options, 3), 0.5, 1e-12);
}

}  // namespace
}  // namespace selfcal
