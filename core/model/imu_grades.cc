#include "core/model/imu_grades.h"

#include <string>

#include "core/model/parameter_blocks.h"

namespace selfcal {
namespace {

std::vector<ComponentSetting> Tolerances(double GradeTolerance::*grade) {
  std::vector<ComponentSetting> settings;
  for (const auto& block : kImuBlocks) {
    if (block.info.tolerance.*grade == 0) continue;
    settings.push_back({"imu." + std::string(block.info.name) + ".*",
                        block.info.tolerance.*grade});
  }
  return settings;
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
      return Tolerances(&GradeTolerance::consumer);
    case ImuGrade::kFactoryCalibrated:
      return Tolerances(&GradeTolerance::factory_calibrated);
    case ImuGrade::kUnknown:
      break;
  }
  return {};
}

}  // namespace selfcal
