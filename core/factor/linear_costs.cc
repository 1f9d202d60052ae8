// The two factors that are linear in their blocks: bias walk and prior.
#include <ceres/sized_cost_function.h>

#include "core/factor/ceres_factors.h"

namespace selfcal {
namespace {

using Eigen::Map;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using Vector6d = Eigen::Matrix<double, 6, 1>;
using Vector9d = Eigen::Matrix<double, 9, 1>;

class BiasWalkCost final : public ceres::SizedCostFunction<6, 9, 9> {
 public:
  explicit BiasWalkCost(const Vector6d& sigmas)
      : inverse_sigmas_(sigmas.cwiseInverse()) {}

  bool Evaluate(double const* const* parameters,
                double* residuals,
                double** jacobians) const override {
    const Map<const Vector9d> vb0(parameters[0]);
    const Map<const Vector9d> vb1(parameters[1]);
    Map<Vector6d> r(residuals);
    r = inverse_sigmas_.cwiseProduct(vb1.tail<6>() - vb0.tail<6>());
    if (jacobians == nullptr) return true;
    for (int block : {0, 1}) {
      if (jacobians[block] == nullptr) continue;
      Map<Eigen::Matrix<double, 6, 9, Eigen::RowMajor>> J(jacobians[block]);
      J.setZero();
      J.rightCols<6>().diagonal() =
          block == 0 ? -inverse_sigmas_ : inverse_sigmas_;
    }
    return true;
  }

 private:
  Vector6d inverse_sigmas_;
};

class PriorCost final : public ceres::CostFunction {
 public:
  PriorCost(const MatrixXd& square_root, const VectorXd& mean)
      : square_root_(square_root), mean_(mean) {
    set_num_residuals(static_cast<int>(square_root.rows()));
    mutable_parameter_block_sizes()->push_back(static_cast<int>(mean.size()));
  }

  bool Evaluate(double const* const* parameters,
                double* residuals,
                double** jacobians) const override {
    Map<VectorXd>(residuals, square_root_.rows()) =
        square_root_ *
        (Map<const VectorXd>(parameters[0], mean_.size()) - mean_);
    if (jacobians != nullptr && jacobians[0] != nullptr) {
      Map<Eigen::Matrix<double, -1, -1, Eigen::RowMajor>>(
          jacobians[0], square_root_.rows(), square_root_.cols()) =
          square_root_;
    }
    return true;
  }

 private:
  MatrixXd square_root_;
  VectorXd mean_;
};

}  // namespace

std::unique_ptr<ceres::CostFunction> MakeBiasWalkCost(
    const Eigen::Matrix<double, 6, 1>& sigmas) {
  return std::make_unique<BiasWalkCost>(sigmas);
}

std::unique_ptr<ceres::CostFunction> MakePriorCost(
    const Eigen::MatrixXd& square_root, const Eigen::VectorXd& mean) {
  return std::make_unique<PriorCost>(square_root, mean);
}

}  // namespace selfcal
