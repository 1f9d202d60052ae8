// Cameras in Basalt's calibrations.
#pragma once

#include <cstddef>
#include <nlohmann/json.hpp>
#include <vector>

#include "client/formats/format.h"
#include "core/model/camera.h"

namespace selfcal::client {

// Reads a camera. FormatError for other models, and for coefficients that
// selfcal does not have.
CameraCalibration ReadBasaltCamera(const nlohmann::ordered_json& node,
                                   std::vector<Loss>* losses);
void SetBasaltResolution(const nlohmann::ordered_json& size,
                         CameraCalibration* camera);
// FormatError for a model that Basalt does not have; `number` is the camera's.
nlohmann::ordered_json BasaltCameraJson(const CameraCalibration& camera,
                                        std::size_t number);

}  // namespace selfcal::client
