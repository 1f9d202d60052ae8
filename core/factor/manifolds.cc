#include <Eigen/QR>

#include "core/factor/ceres_factors.h"
#include "core/factor/quaternion_block.h"
#include "core/model/so3.h"

namespace selfcal {
namespace {

using Eigen::Map;
using Eigen::MatrixXd;
using Eigen::Quaterniond;
using Eigen::Vector3d;
using Eigen::VectorXd;
template <int rows, int cols>
using RowMajor = Eigen::Matrix<double, rows, cols, Eigen::RowMajor>;
using RowMajorXd = RowMajor<Eigen::Dynamic, Eigen::Dynamic>;

void WriteQuaternion(const Quaterniond& q, double* out) {
  Map<Eigen::Vector4d> coefficients(out);
  coefficients = q.normalized().coeffs();
}

class RotationManifold final : public ceres::Manifold {
 public:
  int AmbientSize() const override { return 4; }
  int TangentSize() const override { return 3; }

  bool Plus(const double* x,
            const double* delta,
            double* x_plus_delta) const override {
    WriteQuaternion(ReadQuaternion(x) * Exp(Map<const Vector3d>(delta)),
                    x_plus_delta);
    return true;
  }

  bool PlusJacobian(const double* x, double* jacobian) const override {
    Map<RowMajor<4, 3>> J(jacobian);
    J = QuaternionPlusJacobian(ReadQuaternion(x));
    return true;
  }

  bool Minus(const double* y,
             const double* x,
             double* y_minus_x) const override {
    Map<Vector3d> delta(y_minus_x);
    delta = Log(ReadQuaternion(x).conjugate() * ReadQuaternion(y));
    return true;
  }

  bool MinusJacobian(const double* x, double* jacobian) const override {
    Map<RowMajor<3, 4>> J(jacobian);
    J = QuaternionMinusJacobian(ReadQuaternion(x));
    return true;
  }
};

// Exp(a) q = q Exp(R^T a) for an axis a in G: the tangent is the right
// perturbation restricted to the first two columns of R^T.
class GaugeRotationManifold final : public ceres::Manifold {
 public:
  int AmbientSize() const override { return 4; }
  int TangentSize() const override { return 2; }

  bool Plus(const double* x,
            const double* delta,
            double* x_plus_delta) const override {
    WriteQuaternion(Exp(Vector3d(delta[0], delta[1], 0)) * ReadQuaternion(x),
                    x_plus_delta);
    return true;
  }

  bool PlusJacobian(const double* x, double* jacobian) const override {
    const Quaterniond q = ReadQuaternion(x);
    Map<RowMajor<4, 2>> J(jacobian);
    J = QuaternionPlusJacobian(q) *
        q.toRotationMatrix().transpose().leftCols<2>();
    return true;
  }

  // The inverse of Plus if y can be reached from x; otherwise the rotation
  // about gravity is removed from the rotation between them.
  bool Minus(const double* y,
             const double* x,
             double* y_minus_x) const override {
    Map<Eigen::Vector2d> delta(y_minus_x);
    delta = Log(ReadQuaternion(y) * ReadQuaternion(x).conjugate()).head<2>();
    return true;
  }

  bool MinusJacobian(const double* x, double* jacobian) const override {
    const Quaterniond q = ReadQuaternion(x);
    Map<RowMajor<2, 4>> J(jacobian);
    J = q.toRotationMatrix().topRows<2>() * QuaternionMinusJacobian(q);
    return true;
  }
};

class SubspaceManifold final : public ceres::Manifold {
 public:
  explicit SubspaceManifold(const MatrixXd& basis)
      : basis_(basis), pseudo_inverse_(basis.cols(), basis.rows()) {
    if (basis.cols() == 0) return;
    pseudo_inverse_ = basis.colPivHouseholderQr().solve(
        MatrixXd::Identity(basis.rows(), basis.rows()));
  }

  int AmbientSize() const override { return static_cast<int>(basis_.rows()); }
  int TangentSize() const override { return static_cast<int>(basis_.cols()); }

  bool Plus(const double* x,
            const double* delta,
            double* x_plus_delta) const override {
    Map<VectorXd>(x_plus_delta, basis_.rows()) =
        Map<const VectorXd>(x, basis_.rows()) +
        basis_ * Map<const VectorXd>(delta, basis_.cols());
    return true;
  }

  bool PlusJacobian(const double*, double* jacobian) const override {
    Map<RowMajorXd>(jacobian, basis_.rows(), basis_.cols()) = basis_;
    return true;
  }

  bool Minus(const double* y,
             const double* x,
             double* y_minus_x) const override {
    Map<VectorXd>(y_minus_x, basis_.cols()) =
        pseudo_inverse_ * (Map<const VectorXd>(y, basis_.rows()) -
                           Map<const VectorXd>(x, basis_.rows()));
    return true;
  }

  bool MinusJacobian(const double*, double* jacobian) const override {
    Map<RowMajorXd>(jacobian, basis_.cols(), basis_.rows()) = pseudo_inverse_;
    return true;
  }

 private:
  MatrixXd basis_;           // D x r
  MatrixXd pseudo_inverse_;  // r x D
};

}  // namespace

std::unique_ptr<ceres::Manifold> MakeRotationManifold() {
  return std::make_unique<RotationManifold>();
}

std::unique_ptr<ceres::Manifold> MakeGaugeRotationManifold() {
  return std::make_unique<GaugeRotationManifold>();
}

std::unique_ptr<ceres::Manifold> MakeSubspaceManifold(
    const Eigen::MatrixXd& basis) {
  return std::make_unique<SubspaceManifold>(basis);
}

}  // namespace selfcal
