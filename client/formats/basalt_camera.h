// Cameras in Basalt's calibrations.
#pragma once

#include <nlohmann/json.hpp>
#include <vector>

#include "client/formats/format.h"
#include "core/model/camera.h"

namespace selfcal::client {

// Reads a camera. FormatError for other models.
CameraCalibration ReadBasaltCamera(const nlohmann::ordered_json& node,
                                   std::vector<Loss>* losses);
void SetBasaltResolution(const nlohmann::ordered_json& size,
                         CameraCalibration* camera);
// Writes a camera, whose model Basalt has.
nlohmann::ordered_json BasaltCameraJson(const CameraCalibration& camera);

}  // namespace selfcal::client
