#include "client/formats/basalt_camera.h"

#include <fmt/format.h>

#include <cstdint>
#include <vector>

#include "client/formats/format_error.h"
#include "client/formats/json_values.h"
#include "client/formats/tool_models.h"

namespace selfcal::client {
namespace {

using Json = nlohmann::ordered_json;

constexpr char kRadTan8[] = "pinhole-radtan8";
// A camera without coefficients, which selfcal has as a radtan8.
constexpr char kIdeal[] = "pinhole";

}  // namespace

CameraCalibration ReadBasaltCamera(const Json& node,
                                   std::vector<Loss>* losses) {
  const Json& type = JsonMember(node, "camera_type");
  if (!type.is_string()) {
    throw FormatError("field 'camera_type' is not a string");
  }
  const Json& values = JsonMember(node, "intrinsics");
  const bool ideal = type == kIdeal;
  const auto found = FindModel(
      "basalt",
      ideal ? kRadTan8 : type.get<std::string>(),
      {},
      [&](const std::string& key) { return JsonNumber(values, key, 0) == 0; });
  if (!found) {
    throw FormatError(fmt::format("camera_type {} is not {} or one of {}",
                                  type.dump(),
                                  kIdeal,
                                  ToolModelNames("basalt")));
  }
  CameraCalibration camera;
  camera.model = found->model;
  camera.distortion = Undistorted(camera.model);
  camera.f = {JsonNumber(values, "fx"), JsonNumber(values, "fy")};
  camera.c = {JsonNumber(values, "cx"), JsonNumber(values, "cy")};
  if (ideal) return camera;
  const std::vector<std::string> names = Words(found->tool->coefficients);
  for (std::size_t i = 0; i < names.size(); ++i) {
    camera.distortion[static_cast<Eigen::Index>(i)] =
        JsonNumber(values, names[i]);
  }
  if (found->tool->name == kRadTan8 && JsonNumber(values, "rpmax", 0) != 0) {
    losses->push_back(
        {"rpmax", "selfcal computes the valid radius of a model", false});
  }
  return camera;
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
  const ToolModel& model = *FindToolModel("basalt", camera.model);
  Json values = {{"fx", camera.f.x()},
                 {"fy", camera.f.y()},
                 {"cx", camera.c.x()},
                 {"cy", camera.c.y()}};
  const std::vector<std::string> names = Words(model.coefficients);
  for (std::size_t i = 0; i < names.size(); ++i) {
    values[names[i]] = camera.distortion[static_cast<Eigen::Index>(i)];
  }
  for (const std::string& key : Words(model.zeros)) values[key] = 0.0;
  // 0: no radius beyond which Basalt rejects points.
  if (model.name == kRadTan8) values["rpmax"] = 0.0;
  return {{"camera_type", model.name}, {"intrinsics", values}};
}

}  // namespace selfcal::client
