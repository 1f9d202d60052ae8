// What the kind of an IMU says about the error of its factory calibration.
#pragma once

#include <optional>
#include <string_view>
#include <vector>

#include "core/model/rig.h"

namespace selfcal {

enum class ImuGrade {
  // A MEMS part as it leaves the fab. Data sheets state tolerances of the
  // sensitivity of 1 % (ST LSM6DSO) to 3 % (InvenSense MPU-6050), and a
  // cross-axis sensitivity of 2 % (the latter), which is a misalignment of one
  // degree; both parts of a package are placed that well.
  kConsumer,
  // Each device was calibrated on a rate table by its maker. Data sheets state
  // misalignments of 0.05 degrees (Analog Devices ADIS16488A, Xsens MTi-100);
  // scales drift with temperature and age by some 0.1 %.
  kFactoryCalibrated,
  // Nothing is known: ten reference sigmas, which is what is taken without
  // prior_sigmas.
  kUnknown,
};

// "consumer", "factory-calibrated" or "unknown"; nothing for another text.
std::optional<ImuGrade> ParseImuGrade(std::string_view text);

// Prior standard deviations of the IMU's components, for Rig::prior_sigmas.
std::vector<ComponentSetting> ImuTolerances(ImuGrade grade);

}  // namespace selfcal
