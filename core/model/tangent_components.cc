// Names, units and reference sigmas of the tangent of theta.
#include <optional>
#include <string>
#include <type_traits>
#include <vector>

#include "core/model/calibration.h"
#include "core/model/camera_model.h"
#include "core/model/parameter_blocks.h"

namespace selfcal {
namespace {

double ReferenceSigma(const Calibration& theta, const BlockPlace& place) {
  if (!place.info.unit.starts_with("px")) return place.info.sigma_ref;
  // A calibration without images has no resolution.
  const int width_px = theta.cameras[place.camera].width_px;
  return place.info.sigma_ref * (width_px > 0 ? width_px : kReferenceWidth_px) /
         kReferenceWidth_px;
}

}  // namespace

std::vector<TangentComponent> TangentComponents(const Calibration& theta) {
  std::vector<TangentComponent> components;
  const auto add = [&]<class Value>(const BlockPlace& place,
                                    const Value& value) {
    const std::string block = place.Name();
    const std::string unit(place.info.unit);
    const double sigma_ref = ReferenceSigma(theta, place);
    const auto add_coefficients = [&](double scale) {
      for (const CameraCoefficient& coefficient :
           ModelInfo(theta.cameras[place.camera].model).coefficients) {
        components.push_back({block + "." + std::string(coefficient.name),
                              unit,
                              scale * coefficient.sigma_ref});
      }
    };
    if constexpr (std::is_same_v<Value, double> ||
                  std::is_same_v<Value, std::optional<double>>) {
      components.push_back({block, unit, sigma_ref});
    } else if constexpr (std::is_same_v<Value, DistortionVector>) {
      add_coefficients(1);
    } else if constexpr (std::is_same_v<Value, OptionalVector>) {
      const Eigen::Index size = value.size();
      if (place.info.sizes[0] == kAsDistortion) {
        add_coefficients(sigma_ref);
        return;
      }
      if (size == 1) {
        components.push_back({block, unit, sigma_ref});
        return;
      }
      for (Eigen::Index i = 0; i < size; ++i) {
        std::string name = block;
        if (size == 9) name += std::string(".") + "xyz"[i / 3];
        components.push_back({name + "." + "xyz"[i % 3], unit, sigma_ref});
      }
    } else {
      for (int i = 0; i < TangentDimension(value); ++i) {
        components.push_back({block + "." + "xyz"[i], unit, sigma_ref});
      }
    }
  };
  VisitBlocks(add, theta);
  return components;
}

std::vector<std::string> ComponentBlocks(const Calibration& theta) {
  std::vector<std::string> blocks;
  VisitBlocks(
      [&](const BlockPlace& place, const auto& value) {
        blocks.insert(blocks.end(), TangentDimension(value), place.Name());
      },
      theta);
  return blocks;
}

}  // namespace selfcal
