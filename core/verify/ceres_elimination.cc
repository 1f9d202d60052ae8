#include "core/verify/ceres_elimination.h"

#include <ceres/crs_matrix.h>
#include <ceres/problem.h>

#include <cmath>
#include <stdexcept>
#include <vector>

#include "core/model/second_imu.h"
#include "core/model/temperature.h"
#include "core/verify/cholmod_elimination.h"
#include "core/verify/scorer.h"
#include "core/verify/segment_problem.h"

namespace selfcal {
namespace {

struct Evaluated {
  Eigen::SparseMatrix<double, Eigen::RowMajor> J;
  Eigen::VectorXd r;
};

Evaluated Evaluate(SegmentProblem* segment) {
  ceres::Problem::EvaluateOptions options;
  options.num_threads = 1;
  options.parameter_blocks = segment->BlocksInOrder();
  std::vector<double> residuals;
  ceres::CRSMatrix jacobian;
  if (!segment->problem()->Evaluate(
          options, nullptr, &residuals, nullptr, &jacobian)) {
    throw std::runtime_error("Ceres cannot evaluate the factors of a segment");
  }
  // Eigen sorts the columns of a row while it copies.
  using Columns = Eigen::SparseMatrix<double, Eigen::ColMajor>;
  const Columns by_column =
      Eigen::Map<const Eigen::SparseMatrix<double, Eigen::RowMajor>>(
          jacobian.num_rows,
          jacobian.num_cols,
          static_cast<Eigen::Index>(jacobian.values.size()),
          jacobian.rows.data(),
          jacobian.cols.data(),
          jacobian.values.data());
  return {by_column,
          Eigen::Map<const Eigen::VectorXd>(
              residuals.data(), static_cast<Eigen::Index>(residuals.size()))};
}

// Root mean squares by kind (rotation, velocity, position, b_a, b_g) of the
// links of one IMU.
std::vector<double> RootMeanSquares(const Eigen::VectorXd& whitened) {
  std::vector<double> rms(kStateKinds, 0);
  const Eigen::Index links = whitened.size() / kStateTangentSize;
  for (int kind = 0; kind < kStateKinds; ++kind) {
    double sum = 0;
    for (Eigen::Index link = 0; link < links; ++link) {
      sum += whitened.segment<3>(kStateTangentSize * link + 3 * kind)
                 .squaredNorm();
    }
    rms[kind] = std::sqrt(sum / (3.0 * static_cast<double>(links)));
  }
  return rms;
}

// The rig without slopes. All of its components are estimated, since slopes of
// those that it holds may be.
Rig WithoutSlopes(const Rig& rig) {
  Rig plain = rig;
  if (!HasSlopes(rig.factory)) return plain;
  plain.prior_mean.reset();  // it has slopes
  plain.factory =
      AtTemperature(rig.factory, rig.factory.reference_temperature_c);
  plain.fixed.clear();
  plain.blocks = {{"*", true}};
  return plain;
}

}  // namespace

bool HasCeres() { return true; }

LinearisedSegment EliminateByCeres(const Rig& of_device,
                                   const Calibration& theta0,
                                   const MotionSegment& segment,
                                   const InlierSelection& selection,
                                   int gauge_keyframe) {
  const Rig rig = WithoutSlopes(of_device);
  SegmentProblem problem(rig, theta0, segment, selection, gauge_keyframe);
  const Evaluated evaluated = Evaluate(&problem);
  const Eigen::Index of_imu =
      kStateTangentSize *
      (static_cast<Eigen::Index>(segment.keyframes.size()) - 1);
  const Eigen::VectorXd inertial = evaluated.r.segment(
      2 * static_cast<Eigen::Index>(selection.inliers.size()),
      ImuCount(theta0) * of_imu);
  const std::vector<int> free = FreeComponents(rig);
  const auto size = static_cast<Eigen::Index>(free.size());
  const auto eliminated = EliminateByCholmod(evaluated.J, evaluated.r, size);
  if (!eliminated) {
    throw std::runtime_error(
        "CHOLMOD finds the factors of a segment not positive definite; choose "
        "the scorer \"structured\"");
  }
  LinearisedSegment result;
  result.inertial_rms = RootMeanSquares(inertial.head(of_imu));
  if (theta0.imu1) {
    result.second_inertial_rms = RootMeanSquares(inertial.tail(of_imu));
  }
  const Eigen::VectorXd prior = PriorSigmas(rig);
  const Eigen::VectorXd unit = prior(free).cwiseInverse();
  // Subtracts the rig's prior, which made it definite.
  const Eigen::MatrixXd of_data =
      eliminated->Lambda - Eigen::MatrixXd::Identity(size, size);
  result.theta.Lambda = Eigen::MatrixXd::Zero(prior.size(), prior.size());
  result.theta.Lambda(free, free) =
      unit.asDiagonal() * of_data * unit.asDiagonal();
  result.theta.eta = Eigen::VectorXd::Zero(prior.size());
  result.theta.eta(free) = unit.cwiseProduct(eliminated->eta);
  result.theta.constant =
      eliminated->squares - evaluated.r.squaredNorm() + inertial.squaredNorm();
  return result;
}

}  // namespace selfcal
