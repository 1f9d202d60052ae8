#include "test/evaluation/parameter_statistics.h"

#include <algorithm>
#include <cmath>

#include "test/evaluation/statistics.h"

namespace selfcal {

Calibration AverageCalibration(const std::vector<Calibration>& thetas) {
  const Calibration& first = thetas.front();
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(TangentSize(first));
  for (const Calibration& theta : thetas) sum += BoxMinus(theta, first);
  Calibration average =
      BoxPlus(first, sum / static_cast<double>(thetas.size()));
  const auto rotation = [&](const auto& of) {
    std::vector<Eigen::Quaterniond> all;
    for (const Calibration& theta : thetas) all.push_back(of(theta));
    return AverageRotation(all);
  };
  average.imu.q_AI =
      rotation([](const Calibration& theta) { return theta.imu.q_AI; });
  for (std::size_t j = 0; j < average.cameras.size(); ++j) {
    average.cameras[j].q_CI = rotation(
        [j](const Calibration& theta) { return theta.cameras[j].q_CI; });
  }
  return average;
}

ParameterStatistics Summarise(const Calibration& truth,
                              const std::vector<Estimate>& estimates) {
  std::vector<Calibration> thetas;
  for (const Estimate& estimate : estimates) thetas.push_back(estimate.theta);
  ParameterStatistics result;
  result.average = AverageCalibration(thetas);
  Eigen::ArrayXd deviations = Eigen::ArrayXd::Zero(TangentSize(truth));
  Eigen::ArrayXd errors = deviations;
  Eigen::ArrayXd variances = deviations;
  for (const Estimate& estimate : estimates) {
    deviations += BoxMinus(estimate.theta, result.average).array().square();
    errors += BoxMinus(estimate.theta, truth).array().square();
    variances += estimate.sigma.array().square();
  }
  const auto n = static_cast<double>(estimates.size());
  result.spread = (deviations / (n - 1)).sqrt();
  result.rms_error = (errors / n).sqrt();
  result.rms_sigma = (variances / n).sqrt();
  return result;
}

ResultTable CompareParameters(
    const Calibration& truth,
    const std::vector<std::pair<std::string, ParameterStatistics>>&
        estimators) {
  std::vector<std::string> columns = {"parameter", "unit", "truth"};
  for (const auto& [name, statistics] : estimators) {
    columns.push_back(name + ": mean");
    columns.push_back(name + ": sd");
    columns.push_back(name + ": rms error");
    columns.push_back(name + ": claimed sigma");
  }
  ResultTable table(columns);
  const std::vector<TangentComponent> components = TangentComponents(truth);
  const Eigen::VectorXd true_values = ReadableValues(truth);
  for (int i = 0; i < true_values.size(); ++i) {
    const bool estimated =
        std::any_of(estimators.begin(), estimators.end(), [i](const auto& one) {
          return one.second.rms_sigma(i) > 0;
        });
    if (!estimated) continue;
    std::vector<Cell> row = {
        components[i].name, components[i].unit, true_values(i)};
    for (const auto& [name, statistics] : estimators) {
      row.emplace_back(ReadableValues(statistics.average)(i));
      row.emplace_back(statistics.spread(i));
      row.emplace_back(statistics.rms_error(i));
      row.emplace_back(statistics.rms_sigma(i));
    }
    table.Add(row);
  }
  return table;
}

std::vector<double> Ratios(const Eigen::VectorXd& a, const Eigen::VectorXd& b) {
  std::vector<double> ratios;
  for (int i = 0; i < b.size(); ++i) {
    if (b(i) != 0) ratios.push_back(a(i) / b(i));
  }
  return ratios;
}

}  // namespace selfcal
