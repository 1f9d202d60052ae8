#include "core/population/estimate.h"

#include <cmath>
#include <limits>
#include <utility>

#include "core/population/consistency.h"
#include "core/population/spread.h"

namespace selfcal {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kMaxRounds = 10;
constexpr int kFolds = 5;
constexpr double kCorrelations[] = {0, 0.2, 0.4, 0.6, 0.8, 0.95};
// Weight of the scale against the devices, in degrees of freedom: so much does
// it count that devices are like the scale.
constexpr double kScaleDegrees = 1;

class Estimation {
 public:
  Estimation(const Calibration& reference,
             const VectorXd& scale,
             std::span<const ThetaInformation> devices,
             const CohortOptions& options)
      : options_(options), count_(static_cast<int>(devices.size())) {
    cohort_.reference = reference;
    cohort_.scale = scale;
    for (const ThetaInformation& device : devices) {
      devices_.push_back(
          {scale.asDiagonal() * device.Lambda * scale.asDiagonal(),
           scale.cwiseProduct(device.eta)});
    }
    for (int i = 0; i < count_; ++i) cohort_.devices.push_back(i);
  }

  Cohort Run() {
    if (count_ < kLeastCohort) {
      Publish(InitialSpread(cohort_.scale.size()));
      return cohort_;
    }
    Publish(RobustSpread(devices_, cohort_.scale.size()));
    for (int round = 0; round < kMaxRounds; ++round) {
      if (!LeaveOutOutliers() && round > 0) break;
      Publish(Pooled(Fit(cohort_.devices, 0)));
    }
    cohort_.correlation = ChooseCorrelation();
    Publish(Pooled(Fit(cohort_.devices, cohort_.correlation)));
    return cohort_;
  }

 private:
  Spread Fit(const std::vector<int>& which, double correlation) const {
    std::vector<ThetaInformation> devices;
    for (const int i : which) devices.push_back(devices_[i]);
    return FitSpread(
        devices, cohort_.scale.size(), correlation, options_.cancelled);
  }

  // Pulls the spread towards the scale, the more the less devices determine it.
  static Spread Pooled(Spread spread) {
    const Eigen::ArrayXd share =
        spread.degrees.array() / (spread.degrees.array() + kScaleDegrees);
    const Eigen::ArrayXd sigmas = spread.S.diagonal().array().sqrt();
    const VectorXd by = sigmas.pow(share - 1);
    spread.S = (by.asDiagonal() * spread.S * by.asDiagonal()).eval();
    return spread;
  }

  void Publish(const Spread& spread) {
    const auto in_tangent_units = [&](const MatrixXd& covariance) {
      return MatrixXd(cohort_.scale.asDiagonal() * covariance *
                      cohort_.scale.asDiagonal());
    };
    cohort_.S = in_tangent_units(spread.S);
    cohort_.mu = cohort_.scale.cwiseProduct(spread.mu);
    cohort_.mu_covariance = in_tangent_units(spread.mu_covariance);
    cohort_.degrees = spread.degrees;
  }

  // True if another set of devices results. A device in the estimate is
  // compared with the rest of it, to first order: it counts less by itself.
  bool LeaveOutOutliers() {
    const double limit = options_.false_alarm / count_;
    std::vector<int> devices, outliers;
    for (int i = 0; i < count_; ++i) {
      const VectorXd inverse = cohort_.scale.cwiseInverse();
      const ThetaInformation device = {
          inverse.asDiagonal() * devices_[i].Lambda * inverse.asDiagonal(),
          inverse.cwiseProduct(devices_[i].eta)};
      const bool consistent =
          CompareWithCohort(cohort_, device).probability >= limit;
      (consistent ? devices : outliers).push_back(i);
    }
    // Most of a cohort are never outliers.
    if (2 * devices.size() <= devices_.size()) return false;
    const bool changed = outliers != cohort_.outliers;
    cohort_.devices = std::move(devices);
    cohort_.outliers = std::move(outliers);
    return changed;
  }

  double ChooseCorrelation() const {
    double best = -std::numeric_limits<double>::infinity();
    double chosen = 0;
    for (const double correlation : kCorrelations) {
      double sum = 0;
      for (int fold = 0; fold < kFolds; ++fold) {
        std::vector<int> others, held_out;
        for (std::size_t i = 0; i < cohort_.devices.size(); ++i) {
          const bool out = static_cast<int>(i) % kFolds == fold;
          (out ? held_out : others).push_back(cohort_.devices[i]);
        }
        const Spread spread = Fit(others, correlation);
        for (const int i : held_out) sum += LogLikelihood(devices_[i], spread);
      }
      if (sum > best) {
        best = sum;
        chosen = correlation;
      }
    }
    return chosen;
  }

  const CohortOptions options_;
  const int count_;
  std::vector<ThetaInformation> devices_;  // in units of the scale
  Cohort cohort_;
};

}  // namespace

Cohort EstimateCohort(const Calibration& reference,
                      const Eigen::VectorXd& scale,
                      std::span<const ThetaInformation> devices,
                      const CohortOptions& options) {
  return Estimation(reference, scale, devices, options).Run();
}

DevicePrediction PredictDevice(const Cohort& cohort) {
  // The expectation of a variance whose logarithm is known with `degrees`.
  const Eigen::ArrayXd degrees = cohort.degrees.array();
  const VectorXd widening =
      (degrees / (degrees + kScaleDegrees).square()).exp();
  return {cohort.mu,
          widening.asDiagonal() * cohort.S * widening.asDiagonal() +
              cohort.mu_covariance};
}

}  // namespace selfcal
