#include "core/population/spread.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

#include "core/model/median.h"
#include "core/population/estimate.h"

namespace selfcal {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// Steps change the standard deviations by less, relative.
constexpr double kSmallChange = 1e-3;
constexpr int kMaxSteps = 200;
// Smallest standard deviation, in units of the scale.
constexpr double kSmallestSigma = 1e-4;

// A device determines a component if its data has more information than the
// scale.
constexpr double kDetermined = 0.5;
// Efficiency of the median deviation from the median, of a normal distribution.
constexpr double kEfficiency = 0.37;
constexpr double kSmallSample = 4;

MatrixXd Identity(Eigen::Index size) { return MatrixXd::Identity(size, size); }

class Fit {
 public:
  Fit(std::span<const ThetaInformation> devices,
      Eigen::Index size,
      double correlation,
      const std::function<bool()>& cancelled)
      : devices_(devices),
        correlation_(correlation),
        cancelled_(cancelled),
        spread_(InitialSpread(size)) {}

  Spread Run() {
    for (int i = 0; i < kMaxSteps; ++i) {
      if (cancelled_ && cancelled_()) break;
      const VectorXd before = spread_.S.diagonal();
      Step();
      const VectorXd change =
          (spread_.S.diagonal().array() / before.array()).log().abs();
      if (change.maxCoeff() < 2 * kSmallChange) break;
    }
    return spread_;
  }

 private:
  void Step() {
    const auto size = spread_.S.rows();
    const MatrixXd S_inverse =
        Eigen::LLT<MatrixXd>(spread_.S).solve(Identity(size));

    // The mean: its prior is as wide as the scale.
    MatrixXd mu_information = Identity(size);
    VectorXd mu_eta = VectorXd::Zero(size);
    std::vector<MatrixXd> covariances;  // of each theta, given mu and S
    for (const ThetaInformation& device : devices_) {
      const Eigen::LLT<MatrixXd> sum(device.Lambda + S_inverse);
      covariances.push_back(sum.solve(Identity(size)));
      const MatrixXd by_eta = S_inverse * covariances.back();
      mu_information += by_eta * device.Lambda;
      mu_eta += by_eta * device.eta;
    }
    const Eigen::LLT<MatrixXd> mu_root(
        0.5 * (mu_information + mu_information.transpose()));
    spread_.mu_covariance = mu_root.solve(Identity(size));
    spread_.mu = mu_root.solve(mu_eta);

    // The spread about it.
    MatrixXd sum = MatrixXd::Zero(size, size);
    spread_.degrees.setZero(size);
    for (std::size_t i = 0; i < devices_.size(); ++i) {
      const ThetaInformation& device = devices_[i];
      const MatrixXd& P = covariances[i];
      const MatrixXd by_mu = P * device.Lambda;
      const VectorXd about = P * (device.eta - device.Lambda * spread_.mu);
      sum += about * about.transpose() + P +
             by_mu * spread_.mu_covariance * by_mu.transpose();
      spread_.degrees.array() +=
          (1 - P.diagonal().array() / spread_.S.diagonal().array()).max(0);
    }
    SetSpread(sum / static_cast<double>(devices_.size()));
    spread_.degrees = (spread_.degrees.array() - 1).max(0);
  }

  // Applies the prior on sigmas, as far as data determines them.
  void SetSpread(const MatrixXd& full) {
    const auto count = static_cast<double>(devices_.size());
    const VectorXd known = spread_.degrees / count;
    const VectorXd sigmas =
        (full.diagonal().array() / (1 - known.array() / (count + 1)))
            .sqrt()
            .max(kSmallestSigma);
    const VectorXd whitening = full.diagonal().cwiseSqrt().cwiseInverse();
    MatrixXd correlation =
        correlation_ * whitening.asDiagonal() * full * whitening.asDiagonal();
    correlation.diagonal().setOnes();
    spread_.S = sigmas.asDiagonal() * correlation * sigmas.asDiagonal();
  }

  const std::span<const ThetaInformation> devices_;
  const double correlation_;
  const std::function<bool()>& cancelled_;
  Spread spread_;
};

}  // namespace

Spread InitialSpread(Eigen::Index size) {
  return {VectorXd::Zero(size),
          Identity(size),
          Identity(size),
          VectorXd::Zero(size)};
}

Spread RobustSpread(std::span<const ThetaInformation> devices,
                    Eigen::Index size) {
  std::vector<VectorXd> estimates, variances;
  for (const ThetaInformation& device : devices) {
    const Eigen::LLT<MatrixXd> sum(device.Lambda + Identity(size));
    const MatrixXd P = sum.solve(Identity(size));
    // Without the part of the prior.
    const Eigen::ArrayXd share = 1 - P.diagonal().array();
    estimates.push_back((P * device.eta).array() / share);
    variances.push_back((share > kDetermined)
                            .select(P.diagonal().array() / share,
                                    std::numeric_limits<double>::infinity()));
  }
  Spread spread = InitialSpread(size);
  for (Eigen::Index j = 0; j < size; ++j) {
    std::vector<double> values, noise;
    for (std::size_t i = 0; i < estimates.size(); ++i) {
      if (!std::isfinite(variances[i](j))) continue;
      values.push_back(estimates[i](j));
      noise.push_back(variances[i](j));
    }
    if (values.size() < kLeastCohort) continue;
    const auto count = static_cast<double>(values.size());
    spread.mu(j) = UpperMedian(values);
    for (double& value : values) value = std::abs(value - spread.mu(j));
    const double sigma = kMadToSigma * UpperMedian(values);
    const double of_noise = UpperMedian(noise);
    // The median deviation of few devices is often too small.
    const double variance = (1 + kSmallSample / count) *
                            std::max(sigma * sigma - of_noise, of_noise);
    spread.S(j, j) = variance;
    spread.mu_covariance(j, j) = variance / count;
    spread.degrees(j) = kEfficiency * count;
  }
  return spread;
}

Spread FitSpread(std::span<const ThetaInformation> devices,
                 Eigen::Index size,
                 double correlation,
                 const std::function<bool()>& cancelled) {
  return Fit(devices, size, correlation, cancelled).Run();
}

double LogLikelihood(const ThetaInformation& device, const Spread& spread) {
  const auto size = spread.S.rows();
  // The mean is not known better than this.
  const MatrixXd S = spread.S + spread.mu_covariance;
  const MatrixXd information =
      Identity(size) + S * device.Lambda;  // |.| = |S| |Lambda + S^-1|
  const VectorXd e = device.eta - device.Lambda * spread.mu;
  const Eigen::PartialPivLU<MatrixXd> lu(information);
  const VectorXd posterior = lu.solve(S * e);
  return -0.5 * lu.matrixLU().diagonal().array().abs().log().sum() +
         0.5 * e.dot(posterior) + spread.mu.dot(device.eta) -
         0.5 * spread.mu.dot(device.Lambda * spread.mu);
}

}  // namespace selfcal
