#include "client/cli/extrinsics_input.h"

#include <absl/status/statusor.h>
#include <fmt/format.h>

#include <Eigen/Geometry>
#include <array>
#include <charconv>
#include <cmath>
#include <set>

namespace selfcal::client {
namespace {

constexpr std::size_t kNumbers = 7;
// Programs that print a transform round its quaternion to three digits.
constexpr double kNormTolerance = 1e-2;

struct Pose {
  std::string camera;
  std::array<double, kNumbers> values{};
};

absl::Status WrongForm(const std::string& text) {
  return absl::InvalidArgumentError(fmt::format(
      "--extrinsics: '{}' is not of the form cam0=PX,PY,PZ,QX,QY,QZ,QW, with "
      "a quaternion of length 1",
      text));
}

absl::StatusOr<Pose> Parse(const std::string& text) {
  const std::size_t equals = text.find('=');
  if (equals == std::string::npos) return WrongForm(text);
  Pose pose{.camera = text.substr(0, equals)};
  const char* at = text.data() + equals + 1;
  const char* const end = text.data() + text.size();
  for (std::size_t i = 0; i < kNumbers; ++i) {
    if (i > 0 && (at == end || *at++ != ',')) return WrongForm(text);
    const auto [rest, error] = std::from_chars(at, end, pose.values[i]);
    if (error != std::errc() || !std::isfinite(pose.values[i])) {
      return WrongForm(text);
    }
    at = rest;
  }
  if (at != end) return WrongForm(text);
  return pose;
}

}  // namespace

absl::Status SetExtrinsics(const std::vector<std::string>& texts,
                           Rig* rig,
                           std::vector<Loss>* losses) {
  std::set<std::string> given;
  for (const std::string& text : texts) {
    const absl::StatusOr<Pose> pose = Parse(text);
    if (!pose.ok()) return pose.status();
    auto& cameras = rig->factory.cameras;
    CameraCalibration* camera = nullptr;
    for (std::size_t j = 0; j < cameras.size(); ++j) {
      if (pose->camera == fmt::format("cam{}", j)) camera = &cameras[j];
    }
    if (camera == nullptr || !given.insert(pose->camera).second) {
      return absl::InvalidArgumentError(
          fmt::format("--extrinsics: {} '{}'",
                      camera == nullptr ? "there is no camera" : "repeats",
                      pose->camera));
    }
    const auto& v = pose->values;
    const Eigen::Quaterniond q_CI(v[6], v[3], v[4], v[5]);
    if (!(std::abs(q_CI.norm() - 1) < kNormTolerance)) return WrongForm(text);
    camera->p_CI = {v[0], v[1], v[2]};
    camera->q_CI = q_CI.normalized();
    std::erase_if(*losses, [&](const Loss& loss) {
      return loss.name == pose->camera + ".extrinsics";
    });
  }
  return absl::OkStatus();
}

}  // namespace selfcal::client
