#include <utility>
#include <vector>

#include "core/factor/ceres_factors.h"
#include "core/model/temperature.h"

namespace selfcal {
namespace {

using RowMajorMatrix =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

class TemperatureCost final : public ceres::CostFunction {
 public:
  TemperatureCost(const Calibration& theta_reference,
                  double temperature_c,
                  std::unique_ptr<ceres::CostFunction> cost)
      : reference_(theta_reference),
        temperature_c_(temperature_c),
        reference_s_(AtTemperature(theta_reference, temperature_c)),
        cost_(std::move(cost)) {
    set_num_residuals(cost_->num_residuals());
    *mutable_parameter_block_sizes() = cost_->parameter_block_sizes();
    mutable_parameter_block_sizes()->front() = TangentSize(theta_reference);
  }

  bool Evaluate(double const* const* parameters,
                double* residuals,
                double** jacobians) const override {
    const auto blocks = parameter_block_sizes().size();
    const Eigen::VectorXd d = Eigen::Map<const Eigen::VectorXd>(
        parameters[0], parameter_block_sizes().front());
    const Calibration theta = BoxPlus(reference_, d);
    const Eigen::VectorXd d_s =
        BoxMinus(AtTemperature(theta, temperature_c_), reference_s_);
    std::vector<const double*> parameters_s(parameters, parameters + blocks);
    parameters_s[0] = d_s.data();
    if (jacobians == nullptr || jacobians[0] == nullptr) {
      return cost_->Evaluate(parameters_s.data(), residuals, jacobians);
    }
    RowMajorMatrix by_theta_s(num_residuals(), d_s.size());
    std::vector<double*> jacobians_s(jacobians, jacobians + blocks);
    jacobians_s[0] = by_theta_s.data();
    if (!cost_->Evaluate(parameters_s.data(), residuals, jacobians_s.data())) {
      return false;
    }
    const Eigen::MatrixXd theta_s_by_offset =
        ThetaByOffset(reference_s_, d_s).inverse() *
        TemperatureDerivative(theta, temperature_c_) *
        ThetaByOffset(reference_, d);
    Eigen::Map<RowMajorMatrix>(jacobians[0], num_residuals(), d.size()) =
        by_theta_s * theta_s_by_offset;
    return true;
  }

 private:
  const Calibration reference_;
  const double temperature_c_;
  const Calibration reference_s_;
  const std::unique_ptr<ceres::CostFunction> cost_;
};

}  // namespace

std::unique_ptr<ceres::CostFunction> MakeTemperatureCost(
    const Calibration& theta_reference,
    double temperature_c,
    std::unique_ptr<ceres::CostFunction> cost) {
  return std::make_unique<TemperatureCost>(
      theta_reference, temperature_c, std::move(cost));
}

}  // namespace selfcal
