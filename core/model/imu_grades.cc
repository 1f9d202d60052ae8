#include "core/model/imu_grades.h"

namespace selfcal {
namespace {

std::vector<ComponentSetting> Tolerances(double scale,
                                         double misalignment,
                                         double rotation_rad) {
  return {{"imu.gyro.scale.*", scale},
          {"imu.gyro.misalignment.*", misalignment},
          {"imu.accel.scale.*", scale},
          {"imu.accel.misalignment.*", misalignment},
          {"imu.q_AI.*", rotation_rad}};
}

}  // namespace

std::optional<ImuGrade> ParseImuGrade(std::string_view text) {
  if (text == "consumer") return ImuGrade::kConsumer;
  if (text == "factory-calibrated") return ImuGrade::kFactoryCalibrated;
  if (text == "unknown") return ImuGrade::kUnknown;
  return std::nullopt;
}

std::vector<ComponentSetting> ImuTolerances(ImuGrade grade) {
  switch (grade) {
    case ImuGrade::kConsumer:
      return Tolerances(2e-2, 2e-2, 2e-2);
    case ImuGrade::kFactoryCalibrated:
      return Tolerances(3e-3, 2e-3, 2e-3);
    case ImuGrade::kUnknown:
      break;
  }
  return {};
}

}  // namespace selfcal
