#include "client/cli/recorded_rig.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "client/cli/extrinsics_input.h"
#include "proto/convert.h"

namespace selfcal::client {
namespace {

constexpr double kFocalTolerance = 0.05;
constexpr double kPrincipalTolerance = 0.02;  // of the width
constexpr double kRotationTolerance_rad = 0.05;
constexpr double kPositionTolerance_m = 0.05;
constexpr double kOffsetTolerance_s = 0.05;
// Of a tracked point, with what is systematic in it.
constexpr double kPixelSigma_px = 0.5;

absl::StatusOr<Rig> StatedBy(const Recording& recording,
                             const std::vector<std::string>& extrinsics,
                             std::vector<Loss>* losses) {
  Rig rig;
  for (const RecordedCamera& camera : recording.cameras()) {
    if (!camera.calibration) {
      return absl::InvalidArgumentError(fmt::format(
          "the recording does not state the calibration of {}: begin with that "
          "of a tool, --from TOOL FILE...",
          camera.name));
    }
    rig.factory.cameras.push_back(*camera.calibration);
  }
  const absl::Status posed = SetExtrinsics(extrinsics, &rig, losses);
  if (!posed.ok()) return posed;
  for (std::size_t j = 0; j < recording.cameras().size(); ++j) {
    const bool given = std::any_of(
        extrinsics.begin(), extrinsics.end(), [&](const std::string& text) {
          return text.starts_with(fmt::format("cam{}=", j));
        });
    if (!given && !recording.cameras()[j].has_pose) {
      return absl::InvalidArgumentError(fmt::format(
          "the recording does not state the pose of cam{}: give it with "
          "--extrinsics, to 10 degrees and 10 cm",
          j));
    }
  }
  return rig;
}

// What precedes the settings of the user, which take precedence.
void AddTolerances(const v1::Rig& rig, RigInput* input) {
  std::vector<std::string> sigmas;
  for (int j = 0; j < rig.factory().cameras_size(); ++j) {
    const auto& camera = rig.factory().cameras(j);
    const std::string name = fmt::format("cam{}", j);
    const double f_px = (camera.f().x() + camera.f().y()) / 2;
    sigmas.push_back(fmt::format("{}.focal={}", name, kFocalTolerance * f_px));
    sigmas.push_back(fmt::format(
        "{}.principal={}", name, kPrincipalTolerance * camera.width_px()));
    sigmas.push_back(fmt::format("{}.q_CI={}", name, kRotationTolerance_rad));
    sigmas.push_back(fmt::format("{}.p_CI={}", name, kPositionTolerance_m));
    sigmas.push_back(
        fmt::format("{}.time_offset={}", name, kOffsetTolerance_s));
  }
  input->prior_sigmas.insert(
      input->prior_sigmas.begin(), sigmas.begin(), sigmas.end());
  input->blocks.insert(input->blocks.begin(), "*.time_offset=on");
  if (!input->pixel_sigma_px) input->pixel_sigma_px = kPixelSigma_px;
}

}  // namespace

double ImuRate(const Recording& recording) {
  const std::vector<ImuSample>& imu = recording.imu();
  std::vector<std::int64_t> steps_ns;
  for (std::size_t i = 1; i < imu.size(); ++i) {
    steps_ns.push_back(imu[i].t_ns - imu[i - 1].t_ns);
  }
  if (steps_ns.empty()) return 1;
  const auto middle =
      steps_ns.begin() + static_cast<std::ptrdiff_t>(steps_ns.size() / 2);
  std::nth_element(steps_ns.begin(), middle, steps_ns.end());
  return 1e9 / static_cast<double>(*middle);
}

absl::StatusOr<v1::Rig> ReadRecordedRig(RigInput input,
                                        const std::vector<std::string>& from,
                                        const Recording& recording,
                                        std::vector<Loss>* losses) {
  if (from.empty()) {
    auto stated = StatedBy(recording, input.extrinsics, losses);
    if (!stated.ok()) return stated.status();
    input.base = *std::move(stated);
  } else {
    input.from = from.front();
    input.files.assign(from.begin() + 1, from.end());
  }
  const auto plain = ReadRig(input, losses);
  if (!plain.ok()) return plain;
  losses->clear();
  AddTolerances(*plain, &input);
  return ReadRig(input, losses);
}

}  // namespace selfcal::client
