#include "core/model/imu.h"

namespace selfcal {

BodyRates CorrectImu(const ImuCalibration& imu,
                     const Eigen::Vector3d& gyro,
                     const Eigen::Vector3d& accel,
                     const Eigen::Vector3d& b_g,
                     const Eigen::Vector3d& b_a) {
  const Eigen::Vector3d f_A =
      imu.T_a().triangularView<Eigen::Upper>().solve(accel - b_a);
  return {imu.T_g().triangularView<Eigen::Upper>().solve(gyro - b_g),
          imu.q_AI.conjugate() * f_A};
}

}  // namespace selfcal
