#include "test/reference/ceres_segment.h"

#include <ceres/covariance.h>
#include <ceres/crs_matrix.h>
#include <ceres/problem.h>

#include <utility>
#include <vector>

namespace selfcal {

CeresSegment::CeresSegment(const Rig& rig,
                           const Calibration& theta0,
                           const MotionSegment& segment,
                           const InlierSelection& selection,
                           int gauge_keyframe)
    : problem_(rig, theta0, segment, selection, gauge_keyframe) {}

Eigen::MatrixXd CeresSegment::Posterior() {
  ceres::Covariance::Options options;
  options.sparse_linear_algebra_library_type = ceres::SUITE_SPARSE;
  options.algorithm_type = ceres::SPARSE_QR;
  options.num_threads = 1;
  ceres::Covariance covariance(options);
  const double* theta = problem_.theta();
  const std::vector<std::pair<const double*, const double*>> wanted = {
      {theta, theta}};
  if (!covariance.Compute(wanted, problem_.problem())) return {};
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> result(
      problem_.theta_size(), problem_.theta_size());
  covariance.GetCovarianceBlockInTangentSpace(theta, theta, result.data());
  return result;
}

bool CeresSegment::Evaluate() {
  ceres::Problem::EvaluateOptions options;
  options.num_threads = 1;
  double cost = 0;
  std::vector<double> residuals;
  ceres::CRSMatrix jacobian;
  return problem_.problem()->Evaluate(
      options, &cost, &residuals, nullptr, &jacobian);
}

}  // namespace selfcal
