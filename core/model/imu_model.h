// The model of the readings of an IMU (ImuCalibration): the only place with its
// arithmetic, in both directions. Derivatives of a motion with respect to its
// parameters are in core/factor.
//
// An IMU without optional blocks has two separate sensors:
//   gyro = T_g w + b_g,   accel = T_a R_AI f + b_a.
// Those of a coupled IMU correct each other. With M = T_a R_AI,
//   gyro  = T_g w + T_s f_A + b_g,
//   accel = M f + s + b_a,   s_j = e_j^T M ([w]x^2 + [dw/dt]x) r_j,
// where f_A = M^-1 (accel - b_a) is the force that the accelerometer reads. The
// correction has no loop: f_A follows from accel, w from gyro and f_A, and the
// force at the origin of the body from both, f = f_A - M^-1 s.
//
// The force on the gyroscope is thus that at the accelerometer, which shares
// its package, not that at the origin of the body. They differ by M^-1 s, so
// that a model with the latter predicts a rate that differs by less than
// |T_s| (|w|^2 + |dw/dt|) |r|: 1e-4 rad/s per cm at 2 rad/s and 10 rad/s^2 for
// the T_s of 7e-4 rad s/m of a poor sensor.
//
// Templates over the scalar: double, or Lanes for several readings at once.
// Pure functions, callable from any thread.
// Source: Rehder et al., "Extending kalibr: Calibrating the Extrinsics of
// Multiple IMUs and of Individual Axes", ICRA 2016.
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
  // A coupled IMU has more.
  double T_s[9];
  double T_a[9];
  double accel_positions[9];  // columns r_x, r_y, r_z
  int g_sensitivity_size;     // components of its blocks
  int position_size;
};

inline ImuCorrection CorrectionOf(const ImuCalibration& imu) {
  using Eigen::Map, Eigen::Matrix3d;
  ImuCorrection correction;
  Map<Matrix3d>(correction.T_g_inverse) = imu.T_g().inverse();
  Map<Matrix3d>(correction.T_a_inverse) = imu.T_a().inverse();
  Map<Matrix3d>(correction.R_IA) = imu.q_AI.toRotationMatrix().transpose();
  Map<Matrix3d>(correction.T_s) = imu.T_s();
  Map<Matrix3d>(correction.T_a) = imu.T_a();
  Map<Matrix3d>(correction.accel_positions) = imu.AccelPositions();
  correction.g_sensitivity_size =
      static_cast<int>(imu.gyro_g_sensitivity.size());
  correction.position_size = static_cast<int>(imu.accel_position.size());
  return correction;
}

// Has an optional block.
inline bool IsCoupled(const ImuCalibration& imu) {
  return imu.gyro_g_sensitivity.size() > 0 || imu.accel_position.size() > 0;
}

// One pair of readings, corrected; h_A = T_a^-1 (accel - b_a) is the specific
// force in A, and f the same in I: of a coupled IMU, f_A.
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

  static Matrix FromColumns(const double* columns) {
    Matrix m;
    for (int i = 0; i < 9; ++i) m(i % 3, i / 3) = T(columns[i]);
    return m;
  }

  Matrix T_g_inverse, T_a_inverse, R_IA;
};

// [w]x^2 + [dw]x.
template <typename T>
Eigen::Matrix<T, 3, 3> ForceByPosition(const Eigen::Matrix<T, 3, 1>& w,
                                       const Eigen::Matrix<T, 3, 1>& dw) {
  Eigen::Matrix<T, 3, 3> S = w * w.transpose();
  const T square = S(0, 0) + S(1, 1) + S(2, 2);
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3, k = (i + 2) % 3;
    S(i, i) -= square;
    S(j, i) += dw[k];
    S(k, i) -= dw[j];
  }
  return S;
}

// The reading s that is due to the positions, with S = [w]x^2 + [dw]x.
template <typename T>
Eigen::Matrix<T, 3, 1> ReadingOfPositions(
    const Eigen::Matrix<T, 3, 3>& accel_by_f,
    const Eigen::Matrix<T, 3, 3>& positions,
    const Eigen::Matrix<T, 3, 3>& S) {
  Eigen::Matrix<T, 3, 1> s;
  for (int j = 0; j < 3; ++j) {
    const Eigen::Matrix<T, 3, 1> force = S * positions.col(j);
    s[j] = accel_by_f(j, 0) * force[0] + accel_by_f(j, 1) * force[1] +
           accel_by_f(j, 2) * force[2];
  }
  return s;
}

template <typename T>
struct CoupledImuModel : ImuModel<T> {
  using typename ImuModel<T>::Vector, typename ImuModel<T>::Matrix;

  explicit CoupledImuModel(const ImuCorrection& correction)
      : ImuModel<T>(correction),
        T_s(this->FromColumns(correction.T_s)),
        T_a(this->FromColumns(correction.T_a)),
        positions(this->FromColumns(correction.accel_positions)),
        accel_by_f(T_a * this->R_IA.transpose()),
        force_by_accel(this->ForceByAccel()),
        g_sensitivity_size(correction.g_sensitivity_size),
        position_size(correction.position_size) {}

  CorrectedReading<T> Correct(const Vector& gyro,
                              const Vector& accel,
                              const Vector& b_g,
                              const Vector& b_a) const {
    CorrectedReading<T> reading;
    reading.h_A = this->T_a_inverse * (accel - b_a);
    reading.f = this->R_IA * reading.h_A;
    reading.w = this->T_g_inverse * (gyro - b_g - T_s * reading.f);
    return reading;
  }

  // The force at the origin of the body, with S of ForceByPosition.
  Vector ForceAtOrigin(const Vector& f_A, const Matrix& S) const {
    return f_A -
           force_by_accel * ReadingOfPositions<T>(accel_by_f, positions, S);
  }

  Matrix T_s, T_a, positions;
  Matrix accel_by_f, force_by_accel;  // M and its inverse
  int g_sensitivity_size, position_size;
};

// Readings without biases. They are linear in the true rate and the force that
// the accelerometer reads, so that the difference of two responses gives the
// difference of their readings.
struct ImuResponse {
  explicit ImuResponse(const ImuCalibration& imu)
      : gyro_by_w(imu.T_g()),
        gyro_by_f(imu.T_s()),
        accel_by_f(imu.T_a() * imu.q_AI.toRotationMatrix()),
        positions(imu.AccelPositions()) {}

  // f_A is the force that the accelerometer reads.
  Eigen::Vector3d Gyro(const Eigen::Vector3d& w_I,
                       const Eigen::Vector3d& f_A) const {
    return gyro_by_w * w_I + gyro_by_f * f_A;
  }
  Eigen::Vector3d Accel(const Eigen::Vector3d& f_A) const {
    return accel_by_f * f_A;
  }
  // The force that the accelerometer reads of a motion whose force at the
  // origin is f_I.
  Eigen::Vector3d ForceRead(const Eigen::Vector3d& w_I,
                            const Eigen::Vector3d& dw_I,
                            const Eigen::Vector3d& f_I) const {
    if (positions.isZero(0)) return f_I;
    return f_I +
           accel_by_f.partialPivLu().solve(ReadingOfPositions<double>(
               accel_by_f, positions, ForceByPosition<double>(w_I, dw_I)));
  }

  ImuResponse& operator-=(const ImuResponse& other) {
    gyro_by_w -= other.gyro_by_w;
    gyro_by_f -= other.gyro_by_f;
    accel_by_f -= other.accel_by_f;
    return *this;
  }

  Eigen::Matrix3d gyro_by_w, gyro_by_f, accel_by_f;
  Eigen::Matrix3d positions;  // columns r_x, r_y, r_z
};

}  // namespace selfcal
