#include "core/information/fusion.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "core/information/rig_components.h"
#include "core/information/unobserved.h"

namespace selfcal {
namespace {

// The coordinates of rotations are nonlinear: the step is repeated from its
// result until it is this small, in sigmas of the prior.
constexpr double kSmallStep = 1e-9;
constexpr int kMaxSteps = 20;

class FusionProblem {
 public:
  FusionProblem(const Rig& rig, std::span<const SegmentInformation> segments)
      : rig_(rig), components_(rig), segments_(segments) {
    prior_.theta0 = PriorMean(rig);
    prior_.Lambda = components_.prior().cwiseAbs2().cwiseInverse().asDiagonal();
    prior_.eta.setZero(components_.size());
  }

  FusedEstimate Solve() {
    FusedEstimate result;
    result.theta = prior_.theta0;
    for (int i = 0; i < kMaxSteps; ++i) {
      Linearise(result.theta);
      const Eigen::VectorXd step = posterior_.solve(posterior_eta_);
      Eigen::VectorXd delta = Eigen::VectorXd::Zero(components_.size());
      delta(components_.free()) = ToTangentUnits(step);
      result.theta = BoxPlus(result.theta, delta);
      if (step.lpNorm<Eigen::Infinity>() < kSmallStep) break;
    }
    Describe(&result);
    return result;
  }

 private:
  // Information about the free components, in units of the prior, about
  // `point`.
  ThetaInformation Normalised(const SegmentInformation& information,
                              const Calibration& point) const {
    const ThetaInformation there = Transport(information, point);
    const Eigen::VectorXd scale = components_.prior()(components_.free());
    return {scale.asDiagonal() *
                there.Lambda(components_.free(), components_.free()) *
                scale.asDiagonal(),
            scale.cwiseProduct(there.eta(components_.free()))};
  }

  Eigen::VectorXd ToTangentUnits(const Eigen::VectorXd& normalised) const {
    return normalised.cwiseProduct(components_.prior()(components_.free()));
  }

  void Linearise(const Calibration& point) {
    const ThetaInformation prior = Normalised(prior_, point);
    sum_.setZero(prior.eta.size(), prior.eta.size());
    posterior_eta_ = prior.eta;
    parts_.clear();
    for (const SegmentInformation& segment : segments_) {
      parts_.push_back(Normalised(segment, point));
      sum_ += parts_.back().Lambda;
      posterior_eta_ += parts_.back().eta;
    }
    posterior_.compute(sum_ + prior.Lambda);
  }

  void Describe(FusedEstimate* result) {
    Linearise(result->theta);
    const auto size = sum_.rows();
    const Eigen::MatrixXd covariance =
        posterior_.solve(Eigen::MatrixXd::Identity(size, size));
    result->covariance.setZero(components_.size(), components_.size());
    const Eigen::VectorXd scale = ToTangentUnits(Eigen::VectorXd::Ones(size));
    result->covariance(components_.free(), components_.free()) =
        scale.asDiagonal() * (0.5 * (covariance + covariance.transpose())) *
        scale.asDiagonal();
    Observability observability =
        AnalyseObservability(sum_, components_.free_names());
    result->rank = observability.rank;
    result->unobserved = std::move(observability.unobserved);
    result->segments = static_cast<int>(segments_.size());
    result->heterogeneity = Heterogeneity(covariance);
    result->reach = Reach(result->theta);
  }

  double Reach(const Calibration& theta) const {
    const Eigen::VectorXd unit = ReferenceSigmas(rig_)(components_.free());
    double largest = 0;
    for (const SegmentInformation& segment : segments_) {
      const Eigen::VectorXd offset = BoxMinus(theta, segment.theta0);
      const Eigen::VectorXd far =
          offset(components_.free()).cwiseQuotient(unit);
      largest = std::max(largest, far.squaredNorm());
    }
    return std::sqrt(largest / static_cast<double>(components_.free().size()));
  }

  // At the estimate, eta of a segment is its remaining gradient. If all is as
  // modelled, its covariance is L - L C L, with the covariance C of the
  // estimate; the expectation of a quadratic form with any weight follows. The
  // weight (L + 1)^-1 scales each direction by the information of the segment
  // relative to the prior.
  double Heterogeneity(const Eigen::MatrixXd& covariance) const {
    double sum = 0;
    double expected = 0;
    for (const ThetaInformation& part : parts_) {
      const Eigen::MatrixXd& L = part.Lambda;
      const Eigen::LLT<Eigen::MatrixXd> weight(
          L + Eigen::MatrixXd::Identity(L.rows(), L.cols()));
      sum += part.eta.dot(weight.solve(part.eta));
      expected += weight.solve(L - L * covariance * L).trace();
    }
    return expected > 0 ? sum / expected : 0;
  }

  const Rig& rig_;
  const RigComponents components_;
  const std::span<const SegmentInformation> segments_;
  SegmentInformation prior_;  // that of the rig, in the form of a segment

  // About the linearisation point of the last Linearise().
  std::vector<ThetaInformation> parts_;
  Eigen::MatrixXd sum_;  // of the segments
  Eigen::LLT<Eigen::MatrixXd> posterior_;
  Eigen::VectorXd posterior_eta_;
};

}  // namespace

ThetaInformation Transport(const SegmentInformation& information,
                           const Calibration& point) {
  const Eigen::VectorXd b = BoxMinus(point, information.theta0);
  const Eigen::MatrixXd M = ThetaByOffset(information.theta0, b).inverse();
  return {M.transpose() * information.Lambda * M,
          M.transpose() * (information.eta - information.Lambda * b)};
}

FusedEstimate Fuse(const Rig& rig,
                   std::span<const SegmentInformation> segments) {
  return FusionProblem(rig, segments).Solve();
}

}  // namespace selfcal
