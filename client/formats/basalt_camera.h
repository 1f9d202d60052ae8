// Basalt's camera models fov, kb4, pinhole-radtan8 and pinhole.
#pragma once

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
nlohmann::ordered_json BasaltCameraJson(const CameraCalibration& camera);

}  // namespace selfcal::client
