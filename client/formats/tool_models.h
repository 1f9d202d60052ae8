// What other tools call the registered camera models.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/model/camera_model.h"

namespace selfcal::client {

// How the tool writes a model, by the name of the tool; null if it does not
// have it.
const ToolModel* FindToolModel(std::string_view tool, DistortionModel model);

// The same; throws a FormatError about camera `camera` if the tool does not
// have its model.
const ToolModel& ToolModelOf(std::string_view tool,
                             std::size_t camera,
                             DistortionModel model);

// The model that the tool writes under these names.
std::optional<DistortionModel> FindModel(std::string_view tool,
                                         std::string_view name,
                                         std::string_view distortion = {});

// "fov, radtan and equidistant": the names that the tool has for its models.
std::string ToolModelNames(std::string_view tool);

// The words of a list that a ToolModel states.
std::vector<std::string> Words(std::string_view list);

}  // namespace selfcal::client
