#include "core/population/consistency.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "core/change/chi_square.h"
#include "core/model/symmetric_eigen.h"

namespace selfcal {

CohortConsistency CompareWithCohort(const Cohort& cohort,
                                    const ThetaInformation& device) {
  const DevicePrediction prediction = PredictDevice(cohort);
  const auto size = prediction.mean.size();
  // In coordinates in which devices of the cohort have unit covariance, the
  // directions of the information: its eigenvalue is how much better the device
  // knows the direction than the cohort.
  const Eigen::LLT<Eigen::MatrixXd> root(prediction.covariance);
  const Eigen::MatrixXd L = root.matrixL();
  const SymmetricEigen eigen(L.transpose() * device.Lambda * L);
  const Eigen::VectorXd e = eigen.eigenvectors().transpose() * L.transpose() *
                            (device.eta - device.Lambda * prediction.mean);

  CohortConsistency result;
  for (Eigen::Index k = 0; k < size; ++k) {
    const double information = eigen.eigenvalues()(k);
    if (information < 1) continue;
    result.statistic += e(k) * e(k) / (information * (1 + information));
    ++result.degrees;
  }
  if (result.degrees == 0) return result;
  result.probability = ChiSquareTail(result.statistic, result.degrees);

  // Each component, given what the device knows of the others.
  const Eigen::MatrixXd posterior_gain =
      L * eigen.eigenvectors() *
      (eigen.eigenvalues().array().max(0) + 1).inverse().matrix().asDiagonal();
  const Eigen::VectorXd difference = posterior_gain * e;
  for (Eigen::Index j = 0; j < size; ++j) {
    const double variance =
        (posterior_gain.row(j).array().square() *
         eigen.eigenvalues().array().max(0).transpose() *
         (eigen.eigenvalues().array().max(0) + 1).transpose())
            .sum();
    if (variance < 0.5 * prediction.covariance(j, j)) continue;
    CohortComponent component;
    component.component = static_cast<int>(j);
    component.difference = difference(j);
    component.sigma = std::sqrt(variance);
    component.probability =
        ChiSquareTail(difference(j) * difference(j) / variance, 1);
    result.components.push_back(component);
  }
  std::stable_sort(result.components.begin(),
                   result.components.end(),
                   [](const CohortComponent& a, const CohortComponent& b) {
                     return a.probability < b.probability;
                   });
  if (!result.components.empty()) {
    const double least = result.components.front().probability *
                         static_cast<double>(result.components.size());
    result.probability = std::min(1.0, 2 * std::min(result.probability, least));
  }
  return result;
}

}  // namespace selfcal
