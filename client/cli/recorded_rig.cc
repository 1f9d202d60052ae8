#include "client/cli/recorded_rig.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <utility>

#include "client/cli/extrinsics_input.h"
#include "core/model/camera.h"
#include "core/model/camera_model.h"
#include "core/model/median.h"

namespace selfcal::client {
namespace {

constexpr double kFocalTolerance = 0.05;
constexpr double kPrincipalTolerance = 0.02;  // of the width
constexpr double kRotationTolerance_rad = 0.05;
constexpr double kPositionTolerance_m = 0.05;
constexpr double kOffsetTolerance_s = 0.05;
// The scale in the middle of the image [1/rad], times its width, of a
// camera that nothing states: lenses of 64 and of 160 degrees.
constexpr double kGuessedFocal = 0.8;
constexpr double kGuessedWideFocal = 0.36;
constexpr double kGuessedFocalTolerance = 0.3;
constexpr double kGuessedPosition_m = 0.1;
// Noise of a tracked point, with what is systematic in it.
constexpr double kPixelSigma_px = 0.5;

bool IsPinhole(DistortionModel model) {
  return DistortionName(model).starts_with("radial-tangential");
}

// A camera of which only the images are known.
absl::StatusOr<CameraCalibration> Guess(Recording* recording,
                                        int camera,
                                        DistortionModel model) {
  const auto pixels = recording->ReadImage(camera, 0);
  if (!pixels.ok()) return pixels.status();
  CameraCalibration guess;
  guess.model = model;
  guess.distortion = Undistorted(model);
  if (!IsPinhole(model)) {
    for (int i = 0; i < guess.distortion.size(); ++i) {
      const Interval usual = ModelInfo(model).coefficients[i].usual;
      guess.distortion[i] = (usual.low + usual.high) / 2;
    }
  }
  guess.width_px = pixels->width_px;
  guess.height_px = pixels->height_px;
  guess.c = Eigen::Vector2d(guess.width_px - 1, guess.height_px - 1) / 2;
  guess.f.setOnes();
  const double px_per_rad =
      guess.width_px * (IsPinhole(model) ? kGuessedFocal : kGuessedWideFocal);
  guess.f = px_per_rad / PixelsPerRadian(guess).array();
  return guess;
}

struct Stated {
  Rig rig;
  std::vector<UnknownOfCamera> unknown;
};

absl::StatusOr<Stated> StatedBy(Recording* recording,
                                const std::vector<std::string>& extrinsics,
                                DistortionModel guessed,
                                std::vector<Loss>* losses) {
  Stated stated;
  if (recording->imu_noise()) stated.rig.imu_noise = *recording->imu_noise();
  stated.rig.factory.imu1 = recording->imu1_calibration();
  if (recording->imu1_noise()) stated.rig.imu1_noise = *recording->imu1_noise();
  for (std::size_t j = 0; j < recording->cameras().size(); ++j) {
    const RecordedCamera& camera = recording->cameras()[j];
    const bool given = std::any_of(
        extrinsics.begin(), extrinsics.end(), [&](const std::string& text) {
          return text.starts_with(fmt::format("cam{}=", j));
        });
    UnknownOfCamera unknown{.rotation = !given && !camera.has_pose};
    absl::StatusOr<CameraCalibration> theta = CameraCalibration();
    if (camera.calibration) {
      theta = *camera.calibration;
    } else {
      unknown.focal = true;
      theta = Guess(recording, static_cast<int>(j), guessed);
    }
    if (!theta.ok()) return theta.status();
    stated.rig.factory.cameras.push_back(*theta);
    stated.unknown.push_back(unknown);
  }
  const absl::Status posed = SetExtrinsics(extrinsics, &stated.rig, losses);
  if (!posed.ok()) return posed;
  return stated;
}

// Adds tolerances before the settings of the user, which take precedence.
void AddTolerances(const v1::Rig& rig,
                   const std::vector<UnknownOfCamera>& unknown,
                   RigInput* input) {
  std::vector<std::string> sigmas;
  for (int j = 0; j < rig.factory().cameras_size(); ++j) {
    const auto& camera = rig.factory().cameras(j);
    const std::string name = fmt::format("cam{}", j);
    const double f_px = (camera.f().x() + camera.f().y()) / 2;
    const UnknownOfCamera& of_camera = unknown[static_cast<std::size_t>(j)];
    sigmas.push_back(fmt::format(
        "{}.focal={}",
        name,
        f_px * (of_camera.focal ? kGuessedFocalTolerance : kFocalTolerance)));
    sigmas.push_back(fmt::format(
        "{}.principal={}", name, kPrincipalTolerance * camera.width_px()));
    sigmas.push_back(fmt::format("{}.q_CI={}", name, kRotationTolerance_rad));
    sigmas.push_back(fmt::format(
        "{}.p_CI={}",
        name,
        of_camera.rotation ? kGuessedPosition_m : kPositionTolerance_m));
    sigmas.push_back(
        fmt::format("{}.time_offset={}", name, kOffsetTolerance_s));
  }
  input->prior_sigmas.insert(
      input->prior_sigmas.begin(), sigmas.begin(), sigmas.end());
  input->blocks.insert(input->blocks.begin(), "*.time_offset=on");
  if (!input->pixel_sigma_px) input->pixel_sigma_px = kPixelSigma_px;
}

}  // namespace

double ImuRate(std::span<const ImuSample> imu) {
  std::vector<std::int64_t> steps_ns;
  for (std::size_t i = 1; i < imu.size(); ++i) {
    steps_ns.push_back(imu[i].t_ns - imu[i - 1].t_ns);
  }
  if (steps_ns.empty()) return 1;
  return 1e9 / static_cast<double>(UpperMedian(std::move(steps_ns)));
}

absl::StatusOr<RecordedRig> ReadRecordedRig(
    RigInput input,
    const std::vector<std::string>& from,
    DistortionModel guessed,
    const RecordedSession& session,
    std::vector<Loss>* losses) {
  RecordedRig result;
  if (from.empty() && session.map) {
    input.base = session.map->rig;
  } else if (from.empty()) {
    auto stated =
        StatedBy(session.recording.get(), input.extrinsics, guessed, losses);
    if (!stated.ok()) return stated.status();
    input.base = std::move(stated->rig);
    result.unknown = std::move(stated->unknown);
  } else {
    input.from = from.front();
    input.files.assign(from.begin() + 1, from.end());
  }
  // The tolerances depend on what is read.
  auto rig = ReadRig(input, losses);
  if (!rig.ok()) return rig.status();
  result.unknown.resize(
      static_cast<std::size_t>(rig->factory().cameras_size()));
  AddTolerances(*rig, result.unknown, &input);
  losses->clear();
  rig = ReadRig(input, losses);
  if (!rig.ok()) return rig.status();
  result.rig = *std::move(rig);
  return result;
}

}  // namespace selfcal::client
