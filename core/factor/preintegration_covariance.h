// Covariance of a preintegrated motion, propagated from step to step. Internal
// to core/factor.
#pragma once

#include <Eigen/Core>

#include "core/factor/preintegration_response.h"
#include "core/factor/preintegration_step.h"

namespace selfcal::preintegration {

// Response to errors of a raw reading that are constant in time: derivatives of
// (psi, Delta_v, Delta_p), psi the left perturbation of the rotation; or
// covariances of these with such errors.
template <typename T>
struct GyroResponse {
  Matrix3<T> r = Matrix3<T>::Zero();
  Matrix3<T> v = Matrix3<T>::Zero();
  Matrix3<T> p = Matrix3<T>::Zero();
};
template <typename T>
struct AccelResponse {
  Matrix3<T> v = Matrix3<T>::Zero();
  Matrix3<T> p = Matrix3<T>::Zero();
};

// Covariance of (psi, Delta_v, Delta_p), by blocks; psi is the left
// perturbation of the rotation. Diagonal blocks are stored as lower triangles.
template <typename T>
class MotionCovariance {
 public:
  // Over a step the errors become (psi, v - dv x psi, p + h v - dp x psi).
  void Propagate(const Stage<T>& s) {
    const Matrix3<T> r_r = Symmetric(rr_);
    const Matrix3<T> v_v = Symmetric(vv_);
    const Matrix3<T> p_r = pr_ + s.h * vr_ - Cross<T, 3>(s.dp, r_r);
    const Matrix3<T> v_r = vr_ - Cross<T, 3>(s.dv, r_r);
    const Matrix3<T> r_v = vr_.transpose();
    const Matrix3<T> r_p = pr_.transpose();
    // First the covariance of the new with the old errors, then of the new.
    const Matrix3<T> p_v = pv_ + s.h * v_v - Cross<T, 3>(s.dp, r_v);
    const Matrix3<T> v_v_added =
        TimesSkew<T>(v_r, s.dv) - Cross<T, 3>(s.dv, r_v);
    const Matrix3<T> p_p_added = s.h * (pv_.transpose() + p_v) +
                                 TimesSkew<T>(p_r, s.dp) -
                                 Cross<T, 3>(s.dp, r_p);
    vv_.template triangularView<Eigen::Lower>() += v_v_added;
    pp_.template triangularView<Eigen::Lower>() += p_p_added;
    pv_ = p_v + TimesSkew<T>(p_r, s.dv);
    pr_ = p_r;
    vr_ = v_r;
  }

  // Noise of the raw gyroscope that is constant over the step. The response is
  // a RateResponse or a CoupledRateResponse, both of which begin with offsets.
  template <class Response>
  void AddGyroNoise(const Stage<T>& s,
                    const Response& response,
                    const Matrix3<T>& T_g_inverse,
                    T density) {
    const Matrix3<T> noise = Sigma(s, density) * T_g_inverse;
    const Matrix3<T> r = response.psi.template leftCols<3>().lazyProduct(noise);
    const Matrix3<T> v = response.v.template leftCols<3>().lazyProduct(noise);
    const Matrix3<T> p = response.p.template leftCols<3>().lazyProduct(noise);
    AddLower(r, &rr_);
    vr_ += v.lazyProduct(r.transpose());
    pr_ += p.lazyProduct(r.transpose());
    AddLower(v, &vv_);
    pv_ += p.lazyProduct(v.transpose());
    AddLower(p, &pp_);
  }

  // `correction` is the derivative of the force in the body with respect to the
  // raw reading.
  void AddAccelNoise(const Stage<T>& s,
                     const ForceResponse<T>& response,
                     const Matrix3<T>& correction,
                     T density) {
    const Matrix3<T> noise = Sigma(s, density) * correction;
    const Matrix3<T> v = response.v.lazyProduct(noise);
    const Matrix3<T> p = response.p.lazyProduct(noise);
    Matrix3<T> vv = Matrix3<T>::Zero();
    AddLower(v, &vv);
    vv_ += vv;
    pv_ += p.lazyProduct(v.transpose());
    AddLower(p, &pp_);
    // White noise is not constant over the step: its variation about the mean
    // adds density^2 h^3 / 12 to the variance of the position. Otherwise
    // velocity and position of a single step would be fully correlated and the
    // covariance singular.
    pp_ += s.h * s.h * (1.0 / 12) * vv;
  }

  // Adds a piece of a bias walk (preintegration_bias_walk.h): H J^T + J H^T,
  // and c J_i J_j^T / (n_i + n_j + 1) for blocks i and j.
  void AddWalk(const GyroResponse<T>& J, const GyroResponse<T>& H, T c) {
    AddProducts(J.r, H.r, J.r, H.r, c * (1.0 / 3), &rr_);
    AddProducts(J.v, H.v, J.r, H.r, c * (1.0 / 4), &vr_);
    AddProducts(J.p, H.p, J.r, H.r, c * (1.0 / 5), &pr_);
    AddProducts(J.v, H.v, J.v, H.v, c * (1.0 / 5), &vv_);
    AddProducts(J.p, H.p, J.v, H.v, c * (1.0 / 6), &pv_);
    AddProducts(J.p, H.p, J.p, H.p, c * (1.0 / 7), &pp_);
  }
  void AddWalk(const AccelResponse<T>& J, const AccelResponse<T>& H, T c) {
    AddProducts(J.v, H.v, J.v, H.v, c * (1.0 / 3), &vv_);
    AddProducts(J.p, H.p, J.v, H.v, c * (1.0 / 4), &pv_);
    AddProducts(J.p, H.p, J.p, H.p, c * (1.0 / 5), &pp_);
  }

  Matrix3<T> rr() const { return Symmetric(rr_); }
  const Matrix3<T>& vr() const { return vr_; }
  const Matrix3<T>& pr() const { return pr_; }
  Matrix3<T> vv() const { return Symmetric(vv_); }
  const Matrix3<T>& pv() const { return pv_; }
  Matrix3<T> pp() const { return Symmetric(pp_); }

 private:
  // Sigma of the mean over the step. What it is multiplied with vanishes with
  // h.
  static T Sigma(const Stage<T>& s, T density) {
    return density / Sqrt(Max(s.h, T(1e-30)));
  }

  // The lower triangle of *m += a a^T.
  static void AddLower(const Matrix3<T>& a, Matrix3<T>* m) {
    for (int c = 0; c < 3; ++c) {
      for (int r = c; r < 3; ++r) {
        (*m)(r, c) += a(r, 0) * a(c, 0) + a(r, 1) * a(c, 1) + a(r, 2) * a(c, 2);
      }
    }
  }

  // *m += H_i J_j^T + J_i H_j^T + c J_i J_j^T.
  static void AddProducts(const Matrix3<T>& J_i,
                          const Matrix3<T>& H_i,
                          const Matrix3<T>& J_j,
                          const Matrix3<T>& H_j,
                          T c,
                          Matrix3<T>* m) {
    const Matrix3<T> by_J = H_i + c * J_i;
    *m += by_J.lazyProduct(J_j.transpose());
    *m += J_i.lazyProduct(H_j.transpose());
  }

  static Matrix3<T> Symmetric(const Matrix3<T>& lower) {
    Matrix3<T> m;
    for (int c = 0; c < 3; ++c) {
      for (int r = c; r < 3; ++r) m(r, c) = m(c, r) = lower(r, c);
    }
    return m;
  }

  Matrix3<T> rr_ = Matrix3<T>::Zero();
  Matrix3<T> vr_ = Matrix3<T>::Zero();
  Matrix3<T> pr_ = Matrix3<T>::Zero();
  Matrix3<T> vv_ = Matrix3<T>::Zero();
  Matrix3<T> pv_ = Matrix3<T>::Zero();
  Matrix3<T> pp_ = Matrix3<T>::Zero();
};

}  // namespace selfcal::preintegration
