// The covariance of a preintegrated motion, carried from step to step. Internal
// to core/factor.
#pragma once

#include <Eigen/Core>
#include <cmath>

#include "core/factor/preintegration_step.h"

namespace selfcal::preintegration {

// Covariance of (psi, Delta_v, Delta_p), by blocks; psi is the left
// perturbation of the rotation.
class MotionCovariance {
 public:
  // Over a step the errors become (psi, v - dv x psi, p + h v - dp x psi).
  void Propagate(const Stage& s) {
    const Matrix3d p_r = pr_ + s.h * vr_ - Cross(s.dp, rr_);
    const Matrix3d v_r = vr_ - Cross(s.dv, rr_);
    const Matrix3d r_v = vr_.transpose();
    const Matrix3d r_p = pr_.transpose();
    // Of the new with the old first, then with the new.
    const Matrix3d p_v = pv_ + s.h * vv_ - Cross(s.dp, r_v);
    const Matrix3d p_p = pp_ + s.h * pv_.transpose() - Cross(s.dp, r_p);
    vv_ += TimesSkew(v_r, s.dv) - Cross(s.dv, r_v);
    pv_ = p_v + TimesSkew(p_r, s.dv);
    pp_ = p_p + s.h * p_v + TimesSkew(p_r, s.dp);
    pr_ = p_r;
    vr_ = v_r;
  }

  // Noise that is constant over the step. turn_m and turn_1: derivative of the
  // rotation in the middle and at the end by it.
  void AddGyroNoise(const Stage& s,
                    const Matrix3d& turn_m,
                    const Matrix3d& turn_1,
                    double density) {
    const double sigma = density / std::sqrt(s.h);
    const Matrix3d f_m = Cross(s.f_m, turn_m);
    const Matrix3d r = sigma * turn_1;
    const Matrix3d v = (-sigma * s.h / 6) * (4 * f_m + Cross(s.f_1, turn_1));
    const Matrix3d p = (-sigma * s.h * s.h / 3) * f_m;
    rr_ += r * r.transpose();
    vr_ += v * r.transpose();
    pr_ += p * r.transpose();
    vv_ += v * v.transpose();
    pv_ += p * v.transpose();
    pp_ += p * p.transpose();
  }

  // `correction` is the derivative of the force in the body by the raw reading.
  void AddAccelNoise(const Stage& s,
                     const Matrix3d& correction,
                     double density) {
    const double sigma = density / std::sqrt(s.h);
    const Matrix3d v =
        (sigma * s.h / 6) * (s.R_0 + 4 * s.R_m + s.R_1) * correction;
    const Matrix3d p =
        (sigma * s.h * s.h / 6) * (s.R_0 + 2 * s.R_m) * correction;
    const Matrix3d vv = v * v.transpose();
    vv_ += vv;
    pv_ += p * v.transpose();
    // White noise is not constant over the step: about its mean it moves the
    // position by density^2 h^3 / 12 more. Without that, a single step would
    // tie velocity and position together and leave the covariance singular.
    pp_ += p * p.transpose() + s.h * s.h / 12 * vv;
  }

  // With the rotation perturbed on the right, in the order of Preintegration.
  Eigen::Matrix<double, 9, 9> Result(const Matrix3d& R) const {
    const Matrix3d v_r = vr_ * R;
    const Matrix3d p_r = pr_ * R;
    Eigen::Matrix<double, 9, 9> covariance;
    covariance << R.transpose() * rr_ * R, v_r.transpose(), p_r.transpose(),
        v_r, vv_, pv_.transpose(), p_r, pv_, pp_;
    return covariance;
  }

 private:
  Matrix3d rr_ = Matrix3d::Zero();
  Matrix3d vr_ = Matrix3d::Zero();
  Matrix3d pr_ = Matrix3d::Zero();
  Matrix3d vv_ = Matrix3d::Zero();
  Matrix3d pv_ = Matrix3d::Zero();
  Matrix3d pp_ = Matrix3d::Zero();
};

}  // namespace selfcal::preintegration
