// What other tools call the registered camera models.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/model/camera.h"
#include "core/model/camera_model.h"

namespace selfcal::client {

// How the tool writes a model, by the name of the tool; null if it does not
// have it.
const ToolModel* FindToolModel(std::string_view tool, DistortionModel model);

// Changes cameras whose model the tool does not have to the model that theirs
// extends, if their further coefficients are those of a lens without
// distortion. Throws a FormatError for others.
void UseModelsOf(std::string_view tool,
                 std::vector<CameraCalibration>* cameras);

// A model as the tool writes it.
struct FoundModel {
  DistortionModel model;
  const ToolModel* tool;
};

// The smallest model that the tool writes under these names and that represents
// a file: is_zero(coefficient) must hold for the further coefficients of the
// tool's model.
std::optional<FoundModel> FindModel(
    std::string_view tool,
    std::string_view name,
    std::string_view distortion,
    const std::function<bool(const std::string&)>& is_zero);

// "pinhole-fov, omni-radtan and ds": the names that the tool has for its
// models.
std::string ToolModelNames(std::string_view tool);

// The words of a list that a ToolModel states.
std::vector<std::string> Words(std::string_view list);

}  // namespace selfcal::client
