// The model of the readings of an IMU: the only place with its arithmetic,
//   gyro = T_g w_I + b_g,   accel = T_a R_AI f_I + b_a,
// in both directions. Derivatives of a motion with respect to its parameters
// are in core/factor/imu_derivatives.h.
//
// Templates over the scalar: double, or Lanes for several readings at once.
// Pure functions, callable from any thread.
// Internal to the project: not an installed header.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include "core/model/calibration.h"

namespace selfcal {

// theta_i in the form in which it corrects readings. Plain numbers, which code
// for any width of vectors can share; matrices are column-major.
struct ImuCorrection {
  double T_g_inverse[9];
  double T_a_inverse[9];
  double R_IA[9];
};

inline ImuCorrection CorrectionOf(const ImuCalibration& imu) {
  using Eigen::Map, Eigen::Matrix3d;
  ImuCorrection correction;
  Map<Matrix3d>(correction.T_g_inverse) = imu.T_g().inverse();
  Map<Matrix3d>(correction.T_a_inverse) = imu.T_a().inverse();
  Map<Matrix3d>(correction.R_IA) = imu.q_AI.toRotationMatrix().transpose();
  return correction;
}

// One pair of readings, corrected; h_A = T_a^-1 (accel - b_a) is the specific
// force in A.
template <typename T>
struct CorrectedReading {
  Eigen::Matrix<T, 3, 1> w;
  Eigen::Matrix<T, 3, 1> h_A;
  Eigen::Matrix<T, 3, 1> f;
};

template <typename T>
struct ImuModel {
  using Vector = Eigen::Matrix<T, 3, 1>;
  using Matrix = Eigen::Matrix<T, 3, 3>;

  explicit ImuModel(const ImuCorrection& correction)
      : T_g_inverse(FromColumns(correction.T_g_inverse)),
        T_a_inverse(FromColumns(correction.T_a_inverse)),
        R_IA(FromColumns(correction.R_IA)) {}

  CorrectedReading<T> Correct(const Vector& gyro,
                              const Vector& accel,
                              const Vector& b_g,
                              const Vector& b_a) const {
    CorrectedReading<T> reading;
    reading.w = T_g_inverse * (gyro - b_g);
    reading.h_A = T_a_inverse * (accel - b_a);
    reading.f = R_IA * reading.h_A;
    return reading;
  }

  // Derivative of the specific force with respect to the accelerometer's
  // reading.
  Matrix ForceByAccel() const { return R_IA * T_a_inverse; }

  Matrix T_g_inverse, T_a_inverse, R_IA;

 private:
  static Matrix FromColumns(const double* columns) {
    Matrix m;
    for (int i = 0; i < 9; ++i) m(i % 3, i / 3) = T(columns[i]);
    return m;
  }
};

// Readings without biases. They are linear in the true motion, so that the
// difference of two responses gives the difference of their readings.
struct ImuResponse {
  explicit ImuResponse(const ImuCalibration& imu)
      : gyro_by_w(imu.T_g()),
        accel_by_f(imu.T_a() * imu.q_AI.toRotationMatrix()) {}

  Eigen::Vector3d Gyro(const Eigen::Vector3d& w_I,
                       const Eigen::Vector3d& /*f_I*/) const {
    return gyro_by_w * w_I;
  }
  Eigen::Vector3d Accel(const Eigen::Vector3d& /*w_I*/,
                        const Eigen::Vector3d& f_I) const {
    return accel_by_f * f_I;
  }

  ImuResponse& operator-=(const ImuResponse& other) {
    gyro_by_w -= other.gyro_by_w;
    accel_by_f -= other.accel_by_f;
    return *this;
  }

  Eigen::Matrix3d gyro_by_w, accel_by_f;
};

}  // namespace selfcal
