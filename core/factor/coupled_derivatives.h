// The forces of a coupled IMU (core/model/imu_model.h) over a step, and the
// derivatives of a motion with respect to its biases and intrinsics: what
// imu_derivatives.h and preintegration_jacobians.h are for two separate
// sensors. Internal to core/factor.
//
// Corrected rates w are linear over a step, so that dw/dt is their difference
// divided by h. Integrated over steps, dw/dt x r becomes the difference of the
// velocities w x r at both ends: noise of single samples does not accumulate.
//
// The force at the origin, f = f_A - M^-1 s, depends on the parameters of the
// accelerometer through M f = T_a h_A - s, and on the rates:
//   df = -M^-1 sum_j e_j (dM_j f_j + M_j S dr_j) - M^-1 (D dw + C d(dw/dt)),
// with f_j = f + S r_j the force on axis j, S = [w]x^2 + [dw/dt]x, M_j and D_j
// rows of M and D,
//   D_j = (w . r_j) M_j + (M_j w) r_j^T - 2 (M_j r_j) w^T,   C_j = r_j x M_j.
// The rates change by
//   dw = -T_g^-1 (db_g + dT_g w + dT_s f_A + T_s df_A),
// and f_A by a constant matrix times one of (1, h_A).
#pragma once

#include <Eigen/Core>
#include <array>

#include "core/factor/imu_derivatives.h"
#include "core/factor/preintegration_covariance.h"
#include "core/factor/preintegration_response.h"
#include "core/factor/preintegration_step.h"
#include "core/model/calibration.h"
#include "core/model/imu_model.h"

namespace selfcal::preintegration {

// The rates and forces at one instant of a step; all in the frame of the body.
template <typename T>
struct StageForce {
  Vector3<T> w;
  Vector3<T> f;  // at the origin
  Matrix3<T> S;
};

// Forces at the beginning, the middle and the end of a step.
template <typename T>
struct StepForces {
  StepForces(const CoupledImuModel<T>& imu,
             const Reading<T>& r0,
             const Reading<T>& r1,
             T h)
      // A step of length zero has no difference.
      : dw((r1.w - r0.w) * (1.0 / Max(h, T(1e-300)))) {
    const auto at = [&](const Vector3<T>& w, const Vector3<T>& f_A) {
      const Matrix3<T> S = ForceByPosition<T>(w, dw);
      return StageForce<T>{w, imu.ForceAtOrigin(f_A, S), S};
    };
    begin = at(r0.w, r0.f);
    middle = at(0.5 * (r0.w + r1.w), 0.5 * (r0.f + r1.f));
    end = at(r1.w, r1.f);
  }

  Vector3<T> dw;
  StageForce<T> begin, middle, end;
};

// Changes of the corrected rates: an offset of each axis 3; then for each of
// w_0, w_1, w_2 and of the components of h_A a change of each axis in
// proportion to it, 3.
inline constexpr int kCoupledByRate = 3;
inline constexpr int kCoupledByForce = kCoupledByRate + 9;
inline constexpr int kCoupledChanges = kCoupledByForce + 9;
template <typename T>
using CoupledColumns = Eigen::Matrix<T, 3, kCoupledChanges>;

template <typename T>
struct CoupledRateResponse {
  CoupledColumns<T> psi, v, p;
};

// Values of a weight at both ends of a step.
template <typename T>
struct StepWeight {
  T begin, end;

  T middle() const { return 0.5 * (begin + end); }
};

// Calls use(column, weight) for each three of the changes but the first.
template <typename T, class Use>
void VisitWeights(const Reading<T>& r0, const Reading<T>& r1, const Use& use) {
  for (int c = 0; c < 3; ++c) {
    use(kCoupledByRate + 3 * c, StepWeight<T>{r0.w[c], r1.w[c]});
    use(kCoupledByForce + 3 * c, StepWeight<T>{r0.h_A[c], r1.h_A[c]});
  }
}

// Like ByRates: with dw = e_r y,
//   dphi = (weight_0 y_0 + weight_1 y_1) e_r
//          + e_r x coning (y_0 w_1 - y_1 w_0).
template <typename T>
CoupledColumns<T> ByCoupledRates(const Matrix3<T>& A,
                                 const Turn<T>& turn,
                                 const Reading<T>& r0,
                                 const Reading<T>& r1) {
  CoupledColumns<T> J;
  J.template leftCols<3>() = turn.gain * A - TimesSkew(A, turn.drift);
  VisitWeights<T>(r0, r1, [&](int column, const StepWeight<T>& y) {
    const T gain = turn.weight_0 * y.begin + turn.weight_1 * y.end;
    const Vector3<T> drift = turn.coning * (y.begin * r1.w - y.end * r0.w);
    J.template middleCols<3>(column) = gain * A - TimesSkew(A, drift);
  });
  return J;
}

// The derivative of the force at the origin with respect to the rate, in the
// frame of the first keyframe, at one instant of a step with rotation R.
template <typename T>
Matrix3<T> ForceByRate(const CoupledImuModel<T>& imu,
                       const Matrix3<T>& R_force_by_accel,
                       const Vector3<T>& w) {
  Matrix3<T> D;
  for (int j = 0; j < 3; ++j) {
    const Vector3<T> r = imu.positions.col(j);
    const Vector3<T> m = imu.accel_by_f.row(j).transpose();
    D.row(j) = w.dot(r) * m + m.dot(w) * r - 2.0 * m.dot(r) * w;
  }
  return -R_force_by_accel.lazyProduct(D);
}

// Response of a step to changes of the rates: through its rotation as in
// RespondToRates, and through its forces.
template <typename T>
CoupledRateResponse<T> RespondToCoupledRates(const Stage<T>& s,
                                             const Turn<T>& turn_m,
                                             const Matrix3<T>& A_m,
                                             const Turn<T>& turn_1,
                                             const Reading<T>& r0,
                                             const Reading<T>& r1,
                                             const StepForces<T>& forces,
                                             const CoupledImuModel<T>& imu) {
  const T sixth = s.h * (1.0 / 6);
  CoupledRateResponse<T> response;
  response.psi = ByCoupledRates<T>(turn_1.LeftJacobian(s.R_0), turn_1, r0, r1);
  const CoupledColumns<T> middle =
      ByCoupledRates<T>(Cross<T, 3>(-4.0 * sixth * s.f_m, A_m), turn_m, r0, r1);
  response.v = middle - Cross<T, kCoupledChanges>(sixth * s.f_1, response.psi);
  response.p = 0.5 * s.h * middle;

  const Matrix3<T> L_0 = s.R_0.lazyProduct(imu.force_by_accel);
  const Matrix3<T> L_m = s.R_m.lazyProduct(imu.force_by_accel);
  const Matrix3<T> L_1 = s.R_1.lazyProduct(imu.force_by_accel);
  const Matrix3<T> by_w_0 = sixth * ForceByRate<T>(imu, L_0, forces.begin.w);
  const Matrix3<T> by_w_m =
      4.0 * sixth * ForceByRate<T>(imu, L_m, forces.middle.w);
  const Matrix3<T> by_w_1 = sixth * ForceByRate<T>(imu, L_1, forces.end.w);
  response.v.template leftCols<3>() += by_w_0 + by_w_m + by_w_1;
  response.p.template leftCols<3>() += s.h * (by_w_0 + 0.5 * by_w_m);

  Matrix3<T> C;
  for (int j = 0; j < 3; ++j) {
    C.row(j) = imu.positions.col(j).cross(imu.accel_by_f.row(j).transpose());
  }
  // The response to a difference of one between the ends.
  const Matrix3<T> v_by_dw =
      (-1.0 / 6) * (L_0 + 4.0 * L_m + L_1).lazyProduct(C);
  const Matrix3<T> p_by_dw = -sixth * (L_0 + 2.0 * L_m).lazyProduct(C);
  VisitWeights<T>(r0, r1, [&](int column, const StepWeight<T>& y) {
    const T difference = y.end - y.begin;
    response.v.template middleCols<3>(column) +=
        y.begin * by_w_0 + y.middle() * by_w_m + y.end * by_w_1 +
        difference * v_by_dw;
    response.p.template middleCols<3>(column) +=
        s.h * (y.begin * by_w_0 + (0.5 * y.middle()) * by_w_m) +
        difference * p_by_dw;
  });
  return response;
}

// Like MotionDerivatives, over the optional blocks that the IMU has as well.
template <typename T>
struct CoupledDerivatives {
  Eigen::Matrix<T, 9, 6> bias;
  Eigen::Matrix<T, 9, kMaxImuTangentSize> theta;  // the first `columns`
  int columns = 0;
};

// Integrals of R M^-1 e_j times three weights, for each axis j.
template <typename T>
struct AxisIntegrals {
  std::array<Matrix3<T>, 3> v, p;

  AxisIntegrals() {
    v.fill(Matrix3<T>::Zero());
    p.fill(Matrix3<T>::Zero());
  }

  // Row j of each matrix: the weights of axis j at an instant of the step.
  void Add(const Stage<T>& s,
           const Matrix3<T>& force_by_accel,
           const Matrix3<T>& begin,
           const Matrix3<T>& middle,
           const Matrix3<T>& end) {
    const T sixth = s.h * (1.0 / 6);
    for (int j = 0; j < 3; ++j) {
      const Vector3<T> m = force_by_accel.col(j);
      const Matrix3<T> at_0 = sixth * (s.R_0 * m) * begin.row(j);
      const Matrix3<T> at_m = 2.0 * sixth * (s.R_m * m) * middle.row(j);
      p[j] += s.h * (v[j] + at_0 + at_m);
      v[j] += at_0 + 2.0 * at_m + sixth * (s.R_1 * m) * end.row(j);
    }
  }
};

template <typename T>
class CoupledJacobians {
 public:
  void Add(const Stage<T>& s,
           const CoupledRateResponse<T>& rates,
           const ForceResponse<T>& force,
           const StepForces<T>& forces,
           const CoupledImuModel<T>& imu) {
    PropagateColumns(s, rates, &psi_, &v_, &p_);
    p_by_force_ += s.h * v_by_force_ + force.p;
    v_by_force_ += force.v;
    // Row j: the force on axis j, in A.
    const auto axis_forces = [&](const StageForce<T>& at) {
      Matrix3<T> rows;
      for (int j = 0; j < 3; ++j) {
        rows.row(j) =
            imu.R_IA.transpose() * (at.f + at.S * imu.positions.col(j));
      }
      return rows;
    };
    by_axis_force_.Add(s,
                       imu.force_by_accel,
                       axis_forces(forces.begin),
                       axis_forces(forces.middle),
                       axis_forces(forces.end));
    by_position_.Add(s,
                     imu.force_by_accel,
                     imu.accel_by_f.lazyProduct(forces.begin.S),
                     imu.accel_by_f.lazyProduct(forces.middle.S),
                     imu.accel_by_f.lazyProduct(forces.end.S));
  }

  // The same as in MotionJacobians; the accelerometer's through its forces
  // alone.
  GyroResponse<T> ByGyro(const Matrix3<T>& T_g_inverse) const {
    return {psi_.template leftCols<3>().lazyProduct(T_g_inverse),
            v_.template leftCols<3>().lazyProduct(T_g_inverse),
            p_.template leftCols<3>().lazyProduct(T_g_inverse)};
  }
  AccelResponse<T> ByAccel(const Matrix3<T>& force_by_accel) const {
    return {v_by_force_.lazyProduct(force_by_accel),
            p_by_force_.lazyProduct(force_by_accel)};
  }

  CoupledDerivatives<T> Derivatives(
      const CoupledImuModel<T>& imu,
      const Matrix3<T>& /*force_by_accel*/) const {
    CoupledDerivatives<T> result;
    result.columns =
        kImuTangentSize + imu.g_sensitivity_size + imu.position_size;
    for (int c = kImuTangentSize; c < result.columns; ++c) {
      result.theta.col(c).setZero();
    }
    WriteByRates(psi_, imu, 0, &result);
    WriteByRates(v_, imu, 3, &result);
    WriteByRates(p_, imu, 6, &result);
    AddByForces(v_by_force_, by_axis_force_.v, by_position_.v, imu, 3, &result);
    AddByForces(p_by_force_, by_axis_force_.p, by_position_.p, imu, 6, &result);
    return result;
  }

 private:
  // Through the rates: all columns.
  static void WriteByRates(const CoupledColumns<T>& J,
                           const CoupledImuModel<T>& imu,
                           int row,
                           CoupledDerivatives<T>* result) {
    const Matrix3<T>& B = imu.T_g_inverse;
    const Matrix3<T> by_f = B * imu.T_s;
    const Matrix3<T> by_accel = by_f * imu.force_by_accel;
    const Matrix3<T> offset = J.template leftCols<3>();
    const auto by_w = [&](int c) -> Matrix3<T> {
      return J.template middleCols<3>(kCoupledByRate + 3 * c);
    };
    const auto by_h = [&](int c) -> Matrix3<T> {
      return J.template middleCols<3>(kCoupledByForce + 3 * c);
    };
    result->bias.template block<3, 3>(row, 0) = offset * by_accel;
    result->bias.template block<3, 3>(row, 3) = -offset * B;
    auto theta = result->theta.template middleRows<3>(row);
    // T(i, j) of an upper triangle: scales, then misalignments.
    const auto upper = [](int c, int* i, int* j) {
      *i = c < 3 ? c : c == 5;
      *j = c < 3 ? c : c == 3 ? 1 : 2;
    };
    Matrix3<T> rotation = Matrix3<T>::Zero();
    for (int k = 0; k < 3; ++k) {
      rotation -= TimesSkew<T>(by_h(k) * by_f, imu.R_IA.col(k));
    }
    theta.template middleCols<3>(kAccelRotation) = rotation;
    for (int c = 0; c < 6; ++c) {
      int i, j;
      upper(c, &i, &j);
      theta.col(kGyroScale + c) = -by_w(j) * B.col(i);
      theta.col(kAccelScale + c) = by_h(j) * by_accel.col(i);
    }
    if (imu.g_sensitivity_size == 0) return;
    for (int c = 0; c < 3; ++c) {
      const Matrix3<T> by_f_c = imu.R_IA(c, 0) * by_h(0) +
                                imu.R_IA(c, 1) * by_h(1) +
                                imu.R_IA(c, 2) * by_h(2);
      for (int r = 0; r < 3; ++r) {
        theta.col(kImuTangentSize + 3 * r + c) = -by_f_c * B.col(r);
      }
    }
  }

  // Directly through the forces.
  static void AddByForces(const Matrix3<T>& by_force,
                          const std::array<Matrix3<T>, 3>& by_axis_force,
                          const std::array<Matrix3<T>, 3>& by_position,
                          const CoupledImuModel<T>& imu,
                          int row,
                          CoupledDerivatives<T>* result) {
    result->bias.template block<3, 3>(row, 0) -= by_force * imu.force_by_accel;
    auto theta = result->theta.template middleRows<3>(row);
    for (int j = 0; j < 3; ++j) {
      const Matrix3<T>& K = by_axis_force[j];
      theta.col(kAccelScale + j) -= K.col(j);
      for (int c = j + 1; c < 3; ++c) {
        theta.col(kAccelMisalignment + j + c - 1) -= K.col(c);
      }
      // dM = T_a R_AI [d]x.
      const Vector3<T> T_a_row = imu.T_a.row(j).transpose();
      for (int i = 0; i < 3; ++i) {
        const Vector3<T> axis = imu.R_IA.row(i).transpose();
        theta.col(kAccelRotation + i) += K * axis.cross(T_a_row);
      }
      const int first = kImuTangentSize + imu.g_sensitivity_size +
                        (imu.position_size == 9 ? 3 * j : 0);
      for (int i = 0; i < 3 && imu.position_size > 0; ++i) {
        theta.col(first + i) -= by_position[j].col(i);
      }
    }
  }

  CoupledColumns<T> psi_ = CoupledColumns<T>::Zero();
  CoupledColumns<T> v_ = CoupledColumns<T>::Zero();
  CoupledColumns<T> p_ = CoupledColumns<T>::Zero();
  Matrix3<T> v_by_force_ = Matrix3<T>::Zero();
  Matrix3<T> p_by_force_ = Matrix3<T>::Zero();
  AxisIntegrals<T> by_axis_force_, by_position_;
};

}  // namespace selfcal::preintegration
