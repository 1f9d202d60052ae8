#include "client/formats/tool_models.h"

#include <fmt/format.h>

#include <sstream>

#include "client/formats/format_error.h"

namespace selfcal::client {
namespace {

std::string_view NameOf(const ToolModel& model) {
  return model.distortion.empty() || model.distortion == "none"
             ? model.name
             : model.distortion;
}

// "a, b and c".
std::string Listed(std::vector<std::string_view> names) {
  std::string text;
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (i > 0) text += i + 1 == names.size() ? " and " : ", ";
    text += names[i];
  }
  return text;
}

}  // namespace

const ToolModel* FindToolModel(std::string_view tool, DistortionModel model) {
  for (const ToolModel& candidate : ModelInfo(model).tools) {
    if (candidate.tool == tool) return &candidate;
  }
  return nullptr;
}

const ToolModel& ToolModelOf(std::string_view tool,
                             std::size_t camera,
                             DistortionModel model) {
  if (const ToolModel* found = FindToolModel(tool, model)) return *found;
  std::vector<std::string_view> others;
  for (const ToolModel& other : ModelInfo(model).tools) {
    others.push_back(other.tool);
  }
  throw FormatError(fmt::format(
      "cam{} has the distortion model {}, but {} has only {}; {} have it",
      camera,
      DistortionName(model),
      tool,
      ToolModelNames(tool),
      Listed(others)));
}

std::optional<DistortionModel> FindModel(std::string_view tool,
                                         std::string_view name,
                                         std::string_view distortion) {
  for (const DistortionModel model : DistortionModels()) {
    const ToolModel* candidate = FindToolModel(tool, model);
    if (candidate != nullptr && candidate->name == name &&
        candidate->distortion == distortion) {
      return model;
    }
  }
  return std::nullopt;
}

std::string ToolModelNames(std::string_view tool) {
  std::vector<std::string_view> names;
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
