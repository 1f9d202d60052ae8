#include "client/cli/camera_choice.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>
#include <utility>

#include "proto/nearest_word.h"

namespace selfcal::client {
namespace {

std::string CameraName(std::size_t index) {
  return fmt::format("cam{}", index);
}

void RemoveLossesOf(const std::string& camera, std::vector<Loss>* losses) {
  std::erase_if(*losses, [&camera](const Loss& loss) {
    return loss.name == camera || loss.name.starts_with(camera + ".");
  });
}

}  // namespace

absl::Status KeepCameras(const std::vector<std::string>& names,
                         Rig* rig,
                         std::vector<Loss>* losses) {
  auto& cameras = rig->factory.cameras;
  std::vector<std::string> known;
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    known.push_back(CameraName(i));
  }
  std::set<std::string> wanted;
  for (const std::string& name : names) {
    if (std::find(known.begin(), known.end(), name) == known.end()) {
      return absl::InvalidArgumentError(
          fmt::format("--cameras: there is no camera '{}'{}\n  Known: {}",
                      name,
                      DidYouMean(name, known),
                      fmt::join(known, ", ")));
    }
    if (!wanted.insert(name).second) {
      return absl::InvalidArgumentError(
          fmt::format("--cameras: {} is given twice", name));
    }
  }
  std::vector<CameraCalibration> kept;
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    if (!wanted.contains(known[i])) {
      RemoveLossesOf(known[i], losses);
      continue;
    }
    const std::string name = CameraName(kept.size());
    if (name != known[i]) {
      losses->push_back(
          {known[i], fmt::format("is {} of the rig", name), false});
    }
    kept.push_back(cameras[i]);
  }
  cameras = std::move(kept);
  return absl::OkStatus();
}

}  // namespace selfcal::client
