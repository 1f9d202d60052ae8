#include "core/information/segment_information.h"

#include <Eigen/Eigenvalues>
#include <utility>

#include "core/information/inliers.h"
#include "core/information/linearisation.h"
#include "core/information/unobserved.h"

namespace selfcal {
namespace {

// Information is never negative; what the elimination leaves below zero is
// rounding.
Eigen::MatrixXd WithoutNegativePart(const Eigen::MatrixXd& Lambda) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(Lambda);
  if (eigen.eigenvalues().minCoeff() >= 0) return Lambda;
  const Eigen::MatrixXd root =
      eigen.eigenvectors() *
      eigen.eigenvalues().cwiseMax(0).cwiseSqrt().asDiagonal();
  const Eigen::MatrixXd product = root * root.transpose();
  return product.selfadjointView<Eigen::Lower>();
}

}  // namespace

SegmentInformation ScoreSegment(const Rig& rig,
                                const Calibration& theta0,
                                const MotionSegment& segment,
                                const ScoreOptions& options) {
  SegmentInformation result;
  result.theta0 = theta0;
  InlierSelection selection =
      SelectInliers(theta0, rig.pixel_sigma_px, segment, options);

  const std::vector<int> free = FreeComponents(rig);
  const Eigen::VectorXd prior = PriorSigmas(rig);
  Eigen::VectorXd scale = Eigen::VectorXd::Zero(prior.size());
  scale(free) = prior(free);
  LinearisedSegment linearised = EliminateSegment(
      rig, theta0, segment, selection, scale, options.gauge_keyframe);
  result.residuals = std::move(selection.statistics);
  result.residuals.inertial_rms = std::move(linearised.inertial_rms);

  const Eigen::MatrixXd normalised =
      WithoutNegativePart(linearised.theta.Lambda(free, free));
  const Eigen::VectorXd unit = prior(free).cwiseInverse();
  result.Lambda = Eigen::MatrixXd::Zero(prior.size(), prior.size());
  // Coefficient by coefficient, so that it stays symmetric to the bit.
  result.Lambda(free, free) =
      (unit * unit.transpose()).cwiseProduct(normalised);
  result.eta = Eigen::VectorXd::Zero(prior.size());
  result.eta(free) = unit.cwiseProduct(linearised.theta.eta(free));

  std::vector<std::string> names;
  const auto components = TangentComponents(theta0);
  for (const int i : free) names.push_back(components[i].name);
  Observability observability = AnalyseObservability(normalised, names);
  result.rank = observability.rank;
  result.unobserved = std::move(observability.unobserved);
  result.groups = ScoreGroups(rig, result.Lambda);
  return result;
}

}  // namespace selfcal
