// Names, units and reference sigmas of the tangent of theta.
#include <initializer_list>
#include <string>
#include <utility>
#include <vector>

#include "core/model/calibration.h"

namespace selfcal {
namespace {

// Expected standard deviations after one reference segment: statistics of 22
// moving segments of a hand-held recording with a FOV camera.
constexpr double kSigmaGyroScale = 6e-3;
constexpr double kSigmaGyroMisalignment = 7e-3;
constexpr double kSigmaAccelScale = 4e-2;
constexpr double kSigmaAccelMisalignment = 4e-2;
constexpr double kSigmaAccelRotation = 3.5e-2;
constexpr double kSigmaCameraRotation = 5e-3;
constexpr double kSigmaCameraPosition = 1.3e-2;
// Sigma of f and c for images as wide as those of the recording: in a finer
// image the same errors of the same scene are more pixels.
constexpr double kSigmaPixels = 1.5;
constexpr int kReferenceWidth_px = 640;
constexpr double kSigmaFov = 2.7e-3;
// Median over simulated segments of a hand-held device that moves as calmly as
// in that recording.
constexpr double kSigmaTimeOffset = 6e-4;
// Chosen, not measured: the value that moves a point at the edge of a typical
// image by about kSigmaPixels pixels. These sigmas shift every entropy of a
// group by one constant and do not affect the ranking.
constexpr double kSigmaRadial = 5e-3;
constexpr double kSigmaTangential = 5e-4;
constexpr double kSigmaEquidistant = 5e-3;

using Components = std::vector<TangentComponent>;

void Append(const std::string& block,
            std::initializer_list<const char*> parts,
            const char* unit,
            double sigma_ref,
            Components* components) {
  for (const char* part : parts) {
    components->push_back({block + "." + part, unit, sigma_ref});
  }
}

void AppendDistortion(const std::string& block,
                      DistortionModel model,
                      Components* components) {
  switch (model) {
    case DistortionModel::kFov:
      Append(block, {"w"}, "-", kSigmaFov, components);
      return;
    case DistortionModel::kRadialTangential:
      Append(block, {"k1", "k2"}, "-", kSigmaRadial, components);
      Append(block, {"p1", "p2"}, "-", kSigmaTangential, components);
      return;
    case DistortionModel::kEquidistant:
      Append(
          block, {"k1", "k2", "k3", "k4"}, "-", kSigmaEquidistant, components);
      return;
  }
}

void AppendImu(Components* c) {
  const auto xyz = {"x", "y", "z"};
  Append("imu.gyro.scale", xyz, "-", kSigmaGyroScale, c);
  Append("imu.gyro.misalignment", xyz, "-", kSigmaGyroMisalignment, c);
  Append("imu.accel.scale", xyz, "-", kSigmaAccelScale, c);
  Append("imu.accel.misalignment", xyz, "-", kSigmaAccelMisalignment, c);
  Append("imu.q_AI", xyz, "rad", kSigmaAccelRotation, c);
}

void AppendCamera(const std::string& name,
                  const CameraCalibration& camera,
                  Components* c) {
  const auto xyz = {"x", "y", "z"};
  const auto xy = {"x", "y"};
  Append(name + ".q_CI", xyz, "rad", kSigmaCameraRotation, c);
  Append(name + ".p_CI", xyz, "m", kSigmaCameraPosition, c);
  // A calibration without images has no resolution.
  const int width_px =
      camera.width_px > 0 ? camera.width_px : kReferenceWidth_px;
  const double sigma_px = kSigmaPixels * width_px / kReferenceWidth_px;
  Append(name + ".focal", xy, "px", sigma_px, c);
  Append(name + ".principal", xy, "px", sigma_px, c);
  AppendDistortion(name + ".distortion", camera.model, c);
  c->push_back({name + ".time_offset", "s", kSigmaTimeOffset});
}

}  // namespace

std::vector<TangentComponent> TangentComponents(const Calibration& theta) {
  Components components;
  AppendImu(&components);
  for (std::size_t j = 0; j < theta.cameras.size(); ++j) {
    AppendCamera("cam" + std::to_string(j), theta.cameras[j], &components);
  }
  return components;
}

}  // namespace selfcal
