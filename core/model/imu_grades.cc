#include "core/model/imu_grades.h"

#include "core/model/parameter_blocks.h"

namespace selfcal {
namespace {

std::vector<ComponentSetting> Tolerances(double GradeTolerance::*grade,
                                         const std::string& imu) {
  std::vector<ComponentSetting> settings;
  for (const auto& block : kImuBlocks) {
    if (block.info.tolerance.*grade == 0) continue;
    settings.push_back({imu + "." + std::string(block.info.name) + ".*",
                        block.info.tolerance.*grade});
  }
  return settings;
}

}  // namespace

std::optional<ImuGrade> ParseImuGrade(std::string_view text) {
  for (const ImuGrade grade : {ImuGrade::kConsumer,
                               ImuGrade::kFactoryCalibrated,
                               ImuGrade::kUnknown}) {
    if (text == ImuGradeName(grade)) return grade;
  }
  return std::nullopt;
}

std::string_view ImuGradeName(ImuGrade grade) {
  switch (grade) {
    case ImuGrade::kConsumer:
      return "consumer";
    case ImuGrade::kFactoryCalibrated:
      return "factory-calibrated";
    case ImuGrade::kUnknown:
      break;
  }
  return "unknown";
}

std::vector<ComponentSetting> ImuTolerances(ImuGrade grade,
                                            const std::string& imu) {
  switch (grade) {
    case ImuGrade::kConsumer:
      return Tolerances(&GradeTolerance::consumer, imu);
    case ImuGrade::kFactoryCalibrated:
      return Tolerances(&GradeTolerance::factory_calibrated, imu);
    case ImuGrade::kUnknown:
      break;
  }
  return {};
}

}  // namespace selfcal
