#include "client/formats/tool_models.h"

#include <fmt/format.h>

#include <algorithm>
#include <sstream>

#include "client/formats/format_error.h"

namespace selfcal::client {
namespace {

std::string NameOf(const ToolModel& model) {
  std::string name(model.name);
  if (!model.distortion.empty() && model.distortion != "none") {
    name += "-" + std::string(model.distortion);
  }
  return name;
}

// "a, b and c", each once.
std::string Listed(const std::vector<std::string>& all) {
  std::vector<std::string> names;
  for (const std::string& name : all) {
    if (std::find(names.begin(), names.end(), name) == names.end()) {
      names.push_back(name);
    }
  }
  std::string text;
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (i > 0) text += i + 1 == names.size() ? " and " : ", ";
    text += names[i];
  }
  return text;
}

// True if the model of the camera extends `model`, and is that one.
bool IsExtended(const CameraCalibration& camera, DistortionModel model) {
  const auto all = ModelInfo(camera.model).coefficients;
  const auto first = ModelInfo(model).coefficients;
  if (first.size() >= all.size()) return false;
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (i < first.size() ? all[i].name != first[i].name
                         : camera.distortion[static_cast<Eigen::Index>(i)] !=
                               all[i].undistorted) {
      return false;
    }
  }
  return true;
}

}  // namespace

const ToolModel* FindToolModel(std::string_view tool, DistortionModel model) {
  for (const ToolModel& candidate : ModelInfo(model).tools) {
    if (candidate.tool == tool) return &candidate;
  }
  return nullptr;
}

void UseModelsOf(std::string_view tool,
                 std::vector<CameraCalibration>* cameras) {
  for (std::size_t j = 0; j < cameras->size(); ++j) {
    CameraCalibration& camera = (*cameras)[j];
    for (const DistortionModel model : DistortionModels()) {
      if (FindToolModel(tool, camera.model) != nullptr) break;
      if (FindToolModel(tool, model) == nullptr || !IsExtended(camera, model)) {
        continue;
      }
      camera.model = model;
      camera.distortion.conservativeResize(DistortionSize(model));
    }
    if (FindToolModel(tool, camera.model) != nullptr) continue;
    std::vector<std::string> others;
    for (const ToolModel& other : ModelInfo(camera.model).tools) {
      others.emplace_back(other.tool);
    }
    throw FormatError(fmt::format(
        "cam{} has the distortion model {}, but {} has only {}; {} have it",
        j,
        DistortionName(camera.model),
        tool,
        ToolModelNames(tool),
        Listed(others)));
  }
}

std::optional<FoundModel> FindModel(
    std::string_view tool,
    std::string_view name,
    std::string_view distortion,
    const std::function<bool(const std::string&)>& is_zero) {
  std::optional<FoundModel> found;
  for (const DistortionModel model : DistortionModels()) {
    for (const ToolModel& candidate : ModelInfo(model).tools) {
      if (candidate.tool != tool || candidate.name != name ||
          candidate.distortion != distortion) {
        continue;
      }
      const std::vector<std::string> zeros = Words(candidate.zeros);
      const bool smaller =
          !found || DistortionSize(model) < DistortionSize(found->model);
      if (smaller && std::all_of(zeros.begin(), zeros.end(), is_zero)) {
        found = {model, &candidate};
      }
    }
  }
  return found;
}

std::string ToolModelNames(std::string_view tool) {
  std::vector<std::string> names;
  for (const DistortionModel model : DistortionModels()) {
    const ToolModel* found = FindToolModel(tool, model);
    if (found != nullptr) names.push_back(NameOf(*found));
  }
  return Listed(names);
}

std::vector<std::string> Words(std::string_view list) {
  std::istringstream stream{std::string(list)};
  std::vector<std::string> words;
  for (std::string word; stream >> word;) words.push_back(word);
  return words;
}

}  // namespace selfcal::client
