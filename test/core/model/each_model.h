// Tests with the camera model as their parameter, which run for all of them.
#pragma once

#include <gtest/gtest.h>

#include <string>

#include "core/model/camera_model.h"

namespace selfcal {

inline auto EachCameraModel() {
  return testing::ValuesIn(DistortionModels().begin(),
                           DistortionModels().end());
}

// Its name as part of that of a test.
inline std::string CameraModelName(
    const testing::TestParamInfo<DistortionModel>& info) {
  std::string name(DistortionName(info.param));
  std::erase(name, '-');
  return name;
}

}  // namespace selfcal
