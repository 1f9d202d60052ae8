#include "core/model/imu.h"

#include "core/model/imu_model.h"

namespace selfcal {

BodyRates CorrectImu(const ImuCalibration& imu,
                     const Eigen::Vector3d& gyro,
                     const Eigen::Vector3d& accel,
                     const Eigen::Vector3d& b_g,
                     const Eigen::Vector3d& b_a,
                     const Eigen::Vector3d& dw_I) {
  const ImuCorrection correction = CorrectionOf(imu);
  if (!IsCoupled(imu)) {
    const CorrectedReading<double> reading =
        ImuModel<double>(correction).Correct(gyro, accel, b_g, b_a);
    return {reading.w, reading.f};
  }
  const CoupledImuModel<double> model(correction);
  const CorrectedReading<double> reading = model.Correct(gyro, accel, b_g, b_a);
  return {
      reading.w,
      model.ForceAtOrigin(reading.f, ForceByPosition<double>(reading.w, dw_I))};
}

}  // namespace selfcal
