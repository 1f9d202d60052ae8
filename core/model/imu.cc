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

ImuBiases CarryBiases(const ImuCalibration& from,
                      const ImuCalibration& to,
                      const Eigen::Vector3d& f_I,
                      const ImuBiases& biases) {
  return {
      biases.b_g + (from.T_s() - to.T_s()) * f_I,
      biases.b_a + from.T_a() * (from.q_AI * f_I) - to.T_a() * (to.q_AI * f_I)};
}

}  // namespace selfcal
