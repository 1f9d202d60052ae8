#include "core/model/imu.h"

#include "core/model/imu_model.h"

namespace selfcal {

BodyRates CorrectImu(const ImuCalibration& imu,
                     const Eigen::Vector3d& gyro,
                     const Eigen::Vector3d& accel,
                     const Eigen::Vector3d& b_g,
                     const Eigen::Vector3d& b_a) {
  const CorrectedReading<double> reading =
      ImuModel<double>(CorrectionOf(imu)).Correct(gyro, accel, b_g, b_a);
  return {reading.w, reading.f};
}

}  // namespace selfcal
