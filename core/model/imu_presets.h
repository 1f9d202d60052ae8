// Noise, full scale and tolerances of common IMUs, by the name of the part.
//
// Noise densities are those of the data sheets. A data sheet states the root of
// the one-sided spectrum; the density of ImuNoise is that of the two-sided one,
// smaller by sqrt(2). The figures are used as they are, as Kalibr's wiki does:
// soldering, supply and temperature add to what a manufacturer measures.
//
// Bias random walks are not in data sheets, whose "bias stability" is the
// minimum of the Allan deviation. Where a measured Allan deviation is public,
// the random walk is ten times its rate random walk, the factor that OpenVINS
// uses for what the model leaves out: temperature, vibration, and noise between
// white and random walk. For the others it is the value published with the
// EuRoC recordings (ADIS16448), which is 17 (gyroscope) and 45 (accelerometer)
// times the rate random walk measured of a BMI055.
#pragma once

#include <span>
#include <string_view>

#include "core/model/imu_grades.h"
#include "core/model/rig.h"

namespace selfcal {

struct ImuPreset {
  std::string_view name;  // "bmi055"
  std::string_view part;  // "Bosch BMI055"
  ImuNoise noise;
  // The usual range of a driver, less 0.2 %: readings end at 32767 counts, and
  // a sensitivity that is rounded, as 16.4 counts for 1 deg/s, makes that 1998
  // of 2000 deg/s.
  ImuFullScale full_scale;
  ImuGrade grade = ImuGrade::kUnknown;
  // Sources, for people.
  std::string_view density_source;
  std::string_view walk_source;
  std::string_view range_source;
};

std::span<const ImuPreset> ImuPresets();

// Finds a preset by its name or that of the part without its manufacturer:
// "bmi055", "ICM-20948"; nullptr if there is none. Upper and lower case are the
// same. "LSM6DS", the series, is the LSM6DSO.
const ImuPreset* FindImuPreset(std::string_view name);

}  // namespace selfcal
