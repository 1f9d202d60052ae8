// The covariance of a preintegrated motion, carried from step to step. Internal
// to core/factor.
#pragma once

#include <Eigen/Core>

#include "core/factor/preintegration_step.h"

namespace selfcal::preintegration {

// Lower triangle of *m += a b^T, and of *m += [..] for a product that is
// symmetric.
template <typename T, typename A, typename B>
void AddSymmetric(const A& a, const B& b, Matrix3<T>* m) {
  for (int c = 0; c < 3; ++c) {
    for (int r = c; r < 3; ++r) {
      (*m)(r, c) += a(r, 0) * b(c, 0) + a(r, 1) * b(c, 1) + a(r, 2) * b(c, 2);
    }
  }
}

// Covariance of (psi, Delta_v, Delta_p), by blocks; psi is the left
// perturbation of the rotation.
template <typename T>
class MotionCovariance {
 public:
  // Over a step the errors become (psi, v - dv x psi, p + h v - dp x psi).
  void Propagate(const Stage<T>& s) {
    const Matrix3<T> p_r = pr_ + s.h * vr_ - Cross<T, 3>(s.dp, rr_);
    const Matrix3<T> v_r = vr_ - Cross<T, 3>(s.dv, rr_);
    const Matrix3<T> r_v = vr_.transpose();
    const Matrix3<T> r_p = pr_.transpose();
    // Of the new with the old first, then with the new.
    const Matrix3<T> p_v = pv_ + s.h * vv_ - Cross<T, 3>(s.dp, r_v);
    const Matrix3<T> p_p = pp_ + s.h * pv_.transpose() - Cross<T, 3>(s.dp, r_p);
    vv_ += TimesSkew<T>(v_r, s.dv) - Cross<T, 3>(s.dv, r_v);
    pv_ = p_v + TimesSkew<T>(p_r, s.dv);
    pp_ = p_p + s.h * p_v + TimesSkew<T>(p_r, s.dp);
    pr_ = p_r;
    vr_ = v_r;
  }

  // Noise of the raw gyroscope that is constant over the step.
  void AddGyroNoise(const Stage<T>& s,
                    const RateResponse<T>& response,
                    const Matrix3<T>& T_g_inverse,
                    T density) {
    const Matrix3<T> noise = Sigma(s, density) * T_g_inverse;
    const Matrix3<T> r = response.psi.template leftCols<3>() * noise;
    const Matrix3<T> v = response.v.template leftCols<3>() * noise;
    const Matrix3<T> p = response.p.template leftCols<3>() * noise;
    rr_ += r * r.transpose();
    vr_ += v * r.transpose();
    pr_ += p * r.transpose();
    vv_ += v * v.transpose();
    pv_ += p * v.transpose();
    pp_ += p * p.transpose();
  }

  // `correction` is the derivative of the force in the body by the raw reading.
  void AddAccelNoise(const Stage<T>& s,
                     const ForceResponse<T>& response,
                     const Matrix3<T>& correction,
                     T density) {
    const Matrix3<T> noise = Sigma(s, density) * correction;
    const Matrix3<T> v = response.v * noise;
    const Matrix3<T> p = response.p * noise;
    const Matrix3<T> vv = v * v.transpose();
    vv_ += vv;
    pv_ += p * v.transpose();
    // White noise is not constant over the step: about its mean it moves the
    // position by density^2 h^3 / 12 more. Without that, a single step would
    // tie velocity and position together and leave the covariance singular.
    pp_ += p * p.transpose() + s.h * s.h * (1.0 / 12) * vv;
  }

  const Matrix3<T>& rr() const { return rr_; }
  const Matrix3<T>& vr() const { return vr_; }
  const Matrix3<T>& pr() const { return pr_; }
  const Matrix3<T>& vv() const { return vv_; }
  const Matrix3<T>& pv() const { return pv_; }
  const Matrix3<T>& pp() const { return pp_; }

 private:
  // Of the mean over the step. What it is multiplied with vanishes with h.
  static T Sigma(const Stage<T>& s, T density) {
    return density / Sqrt(Max(s.h, T(1e-30)));
  }

  Matrix3<T> rr_ = Matrix3<T>::Zero();
  Matrix3<T> vr_ = Matrix3<T>::Zero();
  Matrix3<T> pr_ = Matrix3<T>::Zero();
  Matrix3<T> vv_ = Matrix3<T>::Zero();
  Matrix3<T> pv_ = Matrix3<T>::Zero();
  Matrix3<T> pp_ = Matrix3<T>::Zero();
};

}  // namespace selfcal::preintegration
