// A camera's sensor turns radiance into pixels: vignetting, gain, shot and read
// noise, 8 bits.
//
// Pure functions, callable from any thread. The noise of a pixel follows from
// the seed, the camera, the image and the pixel alone.
#pragma once

#include <cstdint>
#include <vector>

#include "core/model/camera.h"

namespace selfcal {

struct GreyImage {
  int width_px = 0;
  int height_px = 0;
  std::vector<std::uint8_t> pixels;  // row by row
};

struct SensorOptions {
  // Loss of light in the corner that is farthest from the principal point; it
  // grows with the square of the distance.
  double vignetting = 0.4;
  // Electrons of radiance 1 without vignetting. At gain 1 they read 255.
  double full_well_e = 8000;
  double read_noise_e = 8;
  // The gain is exp(amplitude sin(2 pi t / period)), as if the exposure were
  // adapted.
  double gain_amplitude = 0;
  double gain_period_s = 4;
  bool noise = true;
};

double GainAt(const SensorOptions& options, double t_s);

// Share of the light that reaches a pixel.
double Vignetting(const CameraCalibration& camera,
                  const SensorOptions& options,
                  const Eigen::Vector2d& z_px);

// Identifies the noise of an image.
struct ImageSeed {
  std::uint64_t seed = 1;
  int camera = 0;
  int image = 0;
};

// Reads out an image: `radiance` has a value in [0, 1] for each pixel.
GreyImage ReadOut(const CameraCalibration& camera,
                  const SensorOptions& options,
                  double gain,
                  const ImageSeed& seed,
                  const std::vector<float>& radiance);

}  // namespace selfcal
