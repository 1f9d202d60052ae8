// Priors of the IMU parameters for common grades of IMU.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/model/rig.h"

namespace selfcal {

enum class ImuGrade {
  // An uncalibrated MEMS part. Data sheets state tolerances of the sensitivity
  // of 1 % (ST LSM6DSO) to 3 % (InvenSense MPU-6050), and a cross-axis
  // sensitivity of 2 % (the latter), which is a misalignment of one degree;
  // both sensors of a package are aligned that well.
  kConsumer,
  // Each device was calibrated on a rate table by its manufacturer. Data sheets
  // state misalignments of 0.05 degrees (Analog Devices ADIS16488A, Xsens
  // MTi-100); scales drift with temperature and age by about 0.1 %.
  kFactoryCalibrated,
  // Nothing is known: ten reference sigmas, the default without prior_sigmas.
  kUnknown,
};

// Parses "consumer", "factory-calibrated" or "unknown"; nullopt for other text.
std::optional<ImuGrade> ParseImuGrade(std::string_view text);
std::string_view ImuGradeName(ImuGrade grade);

// Prior standard deviations of the components of an IMU, "imu" or "imu1", for
// Rig::prior_sigmas.
std::vector<ComponentSetting> ImuTolerances(ImuGrade grade,
                                            const std::string& imu = "imu");

}  // namespace selfcal
