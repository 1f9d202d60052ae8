#include "client/formats/basalt_camera.h"

#include <fmt/format.h>

#include <cstdint>
#include <vector>

#include "client/formats/format_error.h"
#include "client/formats/json_values.h"

namespace selfcal::client {
namespace {

using Json = nlohmann::ordered_json;

struct Model {
  const char* type;
  DistortionModel model;
  std::vector<const char*> coefficients;
};

// For each distortion model, the first entry is the one that is written.
const std::vector<Model>& Models() {
  static const std::vector<Model> models = {
      {"fov", DistortionModel::kFov, {"w"}},
      {"kb4", DistortionModel::kEquidistant, {"k1", "k2", "k3", "k4"}},
      {"pinhole-radtan8",
       DistortionModel::kRadialTangential,
       {"k1", "k2", "p1", "p2"}},
      {"pinhole", DistortionModel::kRadialTangential, {}}};
  return models;
}

// Checks the coefficients of a radtan8 that selfcal does not have.
void CheckRest(const Json& values, std::vector<Loss>* losses) {
  for (const char* key : {"k3", "k4", "k5", "k6"}) {
    if (JsonNumber(values, key, 0) == 0) continue;
    throw FormatError(fmt::format(
        "{} of a pinhole-radtan8 is not 0: selfcal's radial-tangential model "
        "has k1 k2 p1 p2",
        key));
  }
  if (JsonNumber(values, "rpmax", 0) == 0) return;
  losses->push_back(
      {"rpmax", "selfcal computes the valid radius of a model", false});
}

}  // namespace

CameraCalibration ReadBasaltCamera(const Json& node,
                                   std::vector<Loss>* losses) {
  const Json& type = JsonMember(node, "camera_type");
  if (!type.is_string()) {
    throw FormatError("field 'camera_type' is not a string");
  }
  const Json& values = JsonMember(node, "intrinsics");
  for (const Model& model : Models()) {
    if (type != model.type) continue;
    CameraCalibration camera;
    camera.f = {JsonNumber(values, "fx"), JsonNumber(values, "fy")};
    camera.c = {JsonNumber(values, "cx"), JsonNumber(values, "cy")};
    camera.model = model.model;
    camera.distortion = DistortionVector::Zero(DistortionSize(model.model));
    for (std::size_t i = 0; i < model.coefficients.size(); ++i) {
      camera.distortion[static_cast<Eigen::Index>(i)] =
          JsonNumber(values, model.coefficients[i]);
    }
    if (type == "pinhole-radtan8") CheckRest(values, losses);
    return camera;
  }
  throw FormatError(
      fmt::format("camera_type {} is not fov, kb4, pinhole-radtan8 or pinhole",
                  type.dump()));
}

void SetBasaltResolution(const Json& size, CameraCalibration* camera) {
  const auto pixels = [](const Json& value) {
    constexpr std::int64_t kMost =
        1'000'000;  // larger sizes are refused anyway
    if (!value.is_number_integer() || value.get<std::int64_t>() > kMost ||
        value.get<std::int64_t>() < 0) {
      throw FormatError("field 'resolution' needs a width and a height each");
    }
    return static_cast<int>(value.get<std::int64_t>());
  };
  if (!size.is_array() || size.size() != 2) {
    throw FormatError("field 'resolution' needs a width and a height each");
  }
  camera->width_px = pixels(size[0]);
  camera->height_px = pixels(size[1]);
}

Json BasaltCameraJson(const CameraCalibration& camera) {
  for (const Model& model : Models()) {
    if (model.model != camera.model) continue;
    constexpr double kLeastFov = 1e-4;  // below it Basalt's equations fail
    if (camera.model == DistortionModel::kFov &&
        !(camera.distortion[0] > kLeastFov)) {
      throw FormatError("basalt's fov needs a w above 0");
    }
    Json values = {{"fx", camera.f.x()},
                   {"fy", camera.f.y()},
                   {"cx", camera.c.x()},
                   {"cy", camera.c.y()}};
    for (std::size_t i = 0; i < model.coefficients.size(); ++i) {
      values[model.coefficients[i]] =
          camera.distortion[static_cast<Eigen::Index>(i)];
    }
    if (model.model == DistortionModel::kRadialTangential) {
      // 0: no radius beyond which Basalt rejects points.
      for (const char* key : {"k3", "k4", "k5", "k6", "rpmax"}) {
        values[key] = 0.0;
      }
    }
    return {{"camera_type", model.type}, {"intrinsics", values}};
  }
  throw FormatError("basalt does not have this distortion model");
}

}  // namespace selfcal::client
