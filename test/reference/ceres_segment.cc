#include "test/reference/ceres_segment.h"

#include <ceres/covariance.h>
#include <ceres/crs_matrix.h>
#include <ceres/problem.h>

#include <map>
#include <utility>
#include <vector>

#include "core/factor/ceres_factors.h"
#include "core/information/weak_priors.h"

namespace selfcal {
namespace {

// The parameter blocks of ceres_factors.h.
struct Blocks {
  std::vector<double> theta;
  std::vector<Eigen::Vector4d> q;
  std::vector<Eigen::Vector3d> p;
  std::vector<Eigen::Matrix<double, 9, 1>> vb;
  std::map<int, Eigen::Vector3d> l;
};

Blocks MakeBlocks(const Calibration& theta0,
                  const MotionSegment& segment,
                  const InlierSelection& selection) {
  Blocks blocks;
  blocks.theta.assign(static_cast<std::size_t>(TangentSize(theta0)), 0.0);
  for (const KeyframeState& x : segment.keyframes) {
    blocks.q.push_back(x.q_GI.coeffs());
    blocks.p.push_back(x.p_GI);
    blocks.vb.emplace_back() << x.v_GI, x.b_a, x.b_g;
  }
  for (const int index : selection.inliers) {
    const int landmark = segment.observations[index].landmark;
    blocks.l.emplace(landmark, selection.landmarks[landmark]);
  }
  return blocks;
}

void AddPrior(const Eigen::VectorXd& sigmas,
              double* block,
              ceres::Problem* to) {
  const Eigen::MatrixXd square_root = sigmas.cwiseInverse().asDiagonal();
  const Eigen::VectorXd mean =
      Eigen::Map<const Eigen::VectorXd>(block, sigmas.size());
  to->AddResidualBlock(
      MakePriorCost(square_root, mean).release(), nullptr, block);
}

void AddPriors(const Rig& rig, int gauge, Blocks* b, ceres::Problem* problem) {
  Eigen::VectorXd motion(9);
  motion << Eigen::Vector3d::Constant(kVelocityPriorSigma_mps),
      Eigen::Vector3d::Constant(kAccelBiasPriorSigma_mps2),
      Eigen::Vector3d::Constant(kGyroBiasPriorSigma_radps);
  AddPrior(motion, b->vb[0].data(), problem);
  for (auto& [id, l] : b->l) {
    AddPrior(
        Eigen::Vector3d::Constant(kLandmarkPriorSigma_m), l.data(), problem);
  }
  // A quaternion moves by half of the angle.
  AddPrior(Eigen::Vector4d::Constant(kTiltPriorSigma_rad / 2),
           b->q[gauge].data(),
           problem);
  AddPrior(PriorSigmas(rig), b->theta.data(), problem);
}

void AddFactors(const Rig& rig,
                const Calibration& theta0,
                const MotionSegment& segment,
                const InlierSelection& selection,
                Blocks* b,
                ceres::Problem* problem) {
  const KeyframeMotions motions = SegmentMotions(rig, theta0, segment);
  for (const int index : selection.inliers) {
    const Observation& o = segment.observations[index];
    problem->AddResidualBlock(
        MakeReprojectionCost(theta0,
                             o.camera,
                             o.z_px,
                             rig.pixel_sigma_px,
                             std::nullopt,
                             motions.At(o.keyframe, o.camera))
            .release(),
        nullptr,
        b->theta.data(),
        b->q[o.keyframe].data(),
        b->p[o.keyframe].data(),
        b->l.at(o.landmark).data());
  }
  for (std::size_t k = 0; k + 1 < segment.keyframes.size(); ++k) {
    const KeyframeState& x0 = segment.keyframes[k];
    const KeyframeState& x1 = segment.keyframes[k + 1];
    InertialMatrix covariance;
    EvaluateInertial(segment.imu,
                     x0,
                     x1,
                     theta0.imu,
                     rig.imu_noise,
                     rig.gravity_mps2,
                     nullptr,
                     &covariance);
    problem->AddResidualBlock(
        MakeInertialCost(theta0,
                         segment.imu,
                         x0.t_ns,
                         x1.t_ns,
                         rig.imu_noise,
                         rig.gravity_mps2,
                         SquareRootInformation(covariance))
            .release(),
        nullptr,
        b->theta.data(),
        b->q[k].data(),
        b->p[k].data(),
        b->vb[k].data(),
        b->q[k + 1].data(),
        b->p[k + 1].data(),
        b->vb[k + 1].data());
  }
}

}  // namespace

struct CeresSegment::Model {
  Blocks blocks;
  ceres::Problem problem;
  Eigen::Index theta_size = 0;  // of its tangent
};

CeresSegment::CeresSegment(const Rig& rig,
                           const Calibration& theta0,
                           const MotionSegment& segment,
                           const InlierSelection& selection,
                           int gauge_keyframe)
    : model_(std::make_unique<Model>()) {
  Blocks& b = model_->blocks;
  ceres::Problem& problem = model_->problem;
  b = MakeBlocks(theta0, segment, selection);
  AddFactors(rig, theta0, segment, selection, &b, &problem);
  AddPriors(rig, gauge_keyframe, &b, &problem);
  for (int k = 0; k < static_cast<int>(b.q.size()); ++k) {
    auto manifold = k == gauge_keyframe ? MakeGaugeRotationManifold()
                                        : MakeRotationManifold();
    problem.SetManifold(b.q[k].data(), manifold.release());
  }
  problem.SetParameterBlockConstant(b.p[gauge_keyframe].data());
  const std::vector<int> free = FreeComponents(rig);
  const Eigen::VectorXd prior = PriorSigmas(rig);
  model_->theta_size = static_cast<Eigen::Index>(free.size());
  Eigen::MatrixXd basis =
      Eigen::MatrixXd::Zero(prior.size(), model_->theta_size);
  for (Eigen::Index i = 0; i < model_->theta_size; ++i) {
    basis(free[i], i) = prior(free[i]);
  }
  problem.SetManifold(b.theta.data(), MakeSubspaceManifold(basis).release());
}

CeresSegment::~CeresSegment() = default;

Eigen::MatrixXd CeresSegment::Posterior() {
  ceres::Covariance::Options options;
  options.sparse_linear_algebra_library_type = ceres::SUITE_SPARSE;
  options.algorithm_type = ceres::SPARSE_QR;
  options.num_threads = 1;
  ceres::Covariance covariance(options);
  const double* theta = model_->blocks.theta.data();
  const std::vector<std::pair<const double*, const double*>> wanted = {
      {theta, theta}};
  if (!covariance.Compute(wanted, &model_->problem)) return {};
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> result(
      model_->theta_size, model_->theta_size);
  covariance.GetCovarianceBlockInTangentSpace(theta, theta, result.data());
  return result;
}

bool CeresSegment::Evaluate() {
  ceres::Problem::EvaluateOptions options;
  options.num_threads = 1;
  double cost = 0;
  std::vector<double> residuals;
  ceres::CRSMatrix jacobian;
  return model_->problem.Evaluate(
      options, &cost, &residuals, nullptr, &jacobian);
}

}  // namespace selfcal
