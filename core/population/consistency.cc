#include "core/population/consistency.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "core/change/chi_square.h"
#include "core/model/symmetric_eigen.h"
#include "core/population/device.h"
#include "core/population/weighted_chi_square.h"

namespace selfcal {
namespace {

// The information of a device in coordinates in which its prediction has zero
// mean and unit covariance, along its own directions.
struct Whitened {
  Eigen::MatrixXd directions;  // columns, in the coordinates of theta
  // The information of each direction, in units of the prediction's; at least
  // 0.
  Eigen::ArrayXd information;
  Eigen::VectorXd e;  // information times offset
};

Whitened Whiten(const DevicePrediction& prediction,
                const ThetaInformation& device) {
  const Eigen::LLT<Eigen::MatrixXd> root(prediction.covariance);
  const Eigen::MatrixXd L = root.matrixL();
  const SymmetricEigen eigen(L.transpose() * device.Lambda * L);
  return {L * eigen.eigenvectors(),
          eigen.eigenvalues().array().max(0),
          eigen.eigenvectors().transpose() * L.transpose() *
              (device.eta - device.Lambda * prediction.mean)};
}

// Sums over the directions that the device knows at least as well as the
// prediction does.
struct Observed {
  double statistic = 0;
  int degrees = 0;
};

Observed SumObserved(const Whitened& device) {
  Observed sum;
  for (Eigen::Index k = 0; k < device.e.size(); ++k) {
    const double information = device.information(k);
    if (information < 1) continue;
    sum.statistic +=
        device.e(k) * device.e(k) / (information * (1 + information));
    ++sum.degrees;
  }
  return sum;
}

}  // namespace

CohortConsistency CompareWithCohort(const Cohort& cohort,
                                    const ThetaInformation& device) {
  const DevicePrediction prediction = PredictDevice(cohort);
  const Whitened whitened = Whiten(prediction, device);
  const Eigen::ArrayXd& information = whitened.information;
  CohortConsistency result;
  result.probability = WeightedChiSquareTail(
      (whitened.e.array() / (information + 1)).square().sum(),
      information / (information + 1));

  // Each component, given what the device knows of the others.
  const Eigen::MatrixXd posterior_gain =
      whitened.directions * (information + 1).inverse().matrix().asDiagonal();
  const Eigen::VectorXd difference = posterior_gain * whitened.e;
  for (Eigen::Index j = 0; j < difference.size(); ++j) {
    const double variance =
        (posterior_gain.row(j).array().square() * information.transpose() *
         (information + 1).transpose())
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

PriorAgreement CompareWithPrior(const Rig& rig,
                                const Calibration& theta,
                                const Eigen::MatrixXd& covariance) {
  const std::vector<int> free = FreeComponents(rig);
  const Eigen::VectorXd sigmas = PriorSigmas(rig)(free);
  const ThetaInformation all =
      DeviceInformation(rig, theta, covariance, PriorMean(rig));
  const Whitened device = Whiten(
      {Eigen::VectorXd::Zero(sigmas.size()), sigmas.cwiseAbs2().asDiagonal()},
      {all.Lambda(free, free), all.eta(free)});
  PriorAgreement result;
  const Observed observed = SumObserved(device);
  result.statistic = observed.statistic;
  result.degrees = observed.degrees;
  if (result.degrees == 0) return result;
  result.probability = ChiSquareTail(result.statistic, result.degrees);
  // An error of the prior by that ratio is an error of the estimate in the
  // directions that the run held constant.
  const double variance_ratio =
      std::max(1.0, result.statistic / result.degrees);
  result.prior_error_ratio = std::sqrt(variance_ratio);
  result.error_ratio =
      std::sqrt(1 + (variance_ratio - 1) *
                        (device.information < 1).cast<double>().mean());
  return result;
}

}  // namespace selfcal
