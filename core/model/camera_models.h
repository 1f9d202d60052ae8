// The registered camera models. To add one:
//   1. Write it as core/model/camera_NAME.h, or its distortion as
//      distortion_NAME.h if it is a pinhole: camera_model.h states what a model
//      declares.
//   2. Include it here, and append it to CameraModels.
//   3. Add its name to the enumeration DistortionModel of the contract.
//   4. Add it to client/python/selfcal/cameras.py.
// Everything else is derived, and its tests run over all of these models.
// Internal to core/model and core/factor.
#pragma once

#include <span>

#include "core/model/camera_double_sphere.h"
#include "core/model/camera_equidistant.h"
#include "core/model/camera_extended_unified.h"
#include "core/model/camera_model.h"
#include "core/model/camera_unified.h"
#include "core/model/distortion_fov.h"
#include "core/model/distortion_radial_tangential.h"
#include "core/model/distortion_radial_tangential_5.h"
#include "core/model/distortion_radial_tangential_8.h"
#include "core/model/pinhole.h"

namespace selfcal {

template <class... Models>
struct CameraModelList {};

// The index of a model is its DistortionModel.
using CameraModels = CameraModelList<Pinhole<DistortionFov>,
                                     Pinhole<DistortionRadialTangential>,
                                     CameraEquidistant,
                                     Pinhole<DistortionRadialTangential5>,
                                     Pinhole<DistortionRadialTangential8>,
                                     CameraUnified,
                                     CameraExtendedUnified,
                                     CameraDoubleSphere>;

// Calls visit(model) with the camera's model, prepared from its coefficients,
// and returns its result. Returns false if there is no such model, or if the
// number of coefficients does not match it.
template <class Visitor, class... Models>
bool VisitCameraModel(const CameraCalibration& camera,
                      const Visitor& visit,
                      CameraModelList<Models...>) {
  static_assert(((Models::kSize <= kMaxDistortion) && ...),
                "kMaxDistortion is the size of the widest model");
  int index = static_cast<int>(camera.model);
  bool result = false;
  const auto try_model = [&]<class Model>() {
    if (index-- != 0) return false;
    if (camera.distortion.size() == Model::kSize) {
      result = visit(Model(std::span<const double, Model::kSize>(
          camera.distortion.data(), Model::kSize)));
    }
    return true;
  };
  (try_model.template operator()<Models>() || ...);
  return result;
}
template <class Visitor>
bool VisitCameraModel(const CameraCalibration& camera, const Visitor& visit) {
  return VisitCameraModel(camera, visit, CameraModels());
}

}  // namespace selfcal
