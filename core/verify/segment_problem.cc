#include "core/verify/segment_problem.h"

#include <ceres/problem.h>

#include <map>
#include <span>
#include <vector>

#include "core/factor/ceres_factors.h"
#include "core/factor/link_batch.h"
#include "core/information/weak_priors.h"
#include "core/model/second_imu.h"

namespace selfcal {
namespace {

// The parameter blocks of ceres_factors.h.
struct Blocks {
  std::vector<double> theta;
  std::vector<Eigen::Vector4d> q;
  std::vector<Eigen::Vector3d> p;
  // Velocity and biases, of each IMU.
  std::vector<Eigen::Matrix<double, 9, 1>> vb[kMaxImus];
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
    blocks.vb[0].emplace_back() << x.v_GI, x.b_a, x.b_g;
    if (theta0.imu1) blocks.vb[1].emplace_back() << x.v_GJ, x.b_a1, x.b_g1;
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
  for (auto& vb : b->vb) {
    if (!vb.empty()) AddPrior(motion, vb[0].data(), problem);
  }
  for (auto& [id, l] : b->l) {
    AddPrior(
        Eigen::Vector3d::Constant(kLandmarkPriorSigma_m), l.data(), problem);
  }
  // A quaternion changes by half of the angle.
  AddPrior(Eigen::Vector4d::Constant(kTiltPriorSigma_rad / 2),
           b->q[gauge].data(),
           problem);
  AddPrior(PriorSigmas(rig), b->theta.data(), problem);
}

void AddLinks(const Rig& rig,
              const Calibration& theta0,
              const MotionSegment& segment,
              int imu,
              Blocks* b,
              ceres::Problem* problem) {
  const std::span<const ImuSample> samples =
      imu == 0 ? SamplesFromFirstKeyframe(segment)
               : SecondSamplesFromFirstKeyframe(segment);
  const ImuNoise& noise = NoiseOfImu(rig, imu);
  for (std::size_t k = 0; k + 1 < segment.keyframes.size(); ++k) {
    const KeyframeState& x0 = segment.keyframes[k];
    const KeyframeState& x1 = segment.keyframes[k + 1];
    InertialMatrix covariance;
    EvaluateInertial(samples,
                     StateOfImu(theta0, imu, x0),
                     StateOfImu(theta0, imu, x1),
                     ImuOf(theta0, imu),
                     noise,
                     rig.gravity_mps2,
                     nullptr,
                     &covariance);
    problem->AddResidualBlock(
        MakeInertialCost(theta0,
                         imu,
                         samples,
                         x0.t_ns,
                         x1.t_ns,
                         noise,
                         rig.gravity_mps2,
                         SquareRootInformation(covariance))
            .release(),
        nullptr,
        b->theta.data(),
        b->q[k].data(),
        b->p[k].data(),
        b->vb[imu][k].data(),
        b->q[k + 1].data(),
        b->p[k + 1].data(),
        b->vb[imu][k + 1].data());
  }
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
  for (int imu = 0; imu < ImuCount(theta0); ++imu) {
    AddLinks(rig, theta0, segment, imu, b, problem);
  }
}

}  // namespace

struct SegmentProblem::Model {
  Blocks blocks;
  ceres::Problem problem;
};

SegmentProblem::SegmentProblem(const Rig& rig,
                               const Calibration& theta0,
                               const MotionSegment& segment,
                               const InlierSelection& selection,
                               int gauge_keyframe)
    : model_(std::make_unique<Model>()), gauge_keyframe_(gauge_keyframe) {
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
  theta_size_ = static_cast<Eigen::Index>(free.size());
  Eigen::MatrixXd basis = Eigen::MatrixXd::Zero(prior.size(), theta_size_);
  for (Eigen::Index i = 0; i < theta_size_; ++i) {
    basis(free[i], i) = prior(free[i]);
  }
  if (free.empty()) {
    problem.SetParameterBlockConstant(b.theta.data());
  } else {
    problem.SetManifold(b.theta.data(), MakeSubspaceManifold(basis).release());
  }
}

SegmentProblem::~SegmentProblem() = default;

ceres::Problem* SegmentProblem::problem() { return &model_->problem; }

const double* SegmentProblem::theta() const {
  return model_->blocks.theta.data();
}

std::vector<double*> SegmentProblem::BlocksInOrder() {
  Blocks& b = model_->blocks;
  std::vector<double*> order;
  for (auto& [id, l] : b.l) order.push_back(l.data());
  for (int k = 0; k < static_cast<int>(b.q.size()); ++k) {
    order.push_back(b.q[k].data());
    if (k != gauge_keyframe_) order.push_back(b.p[k].data());
    for (auto& vb : b.vb) {
      if (!vb.empty()) order.push_back(vb[k].data());
    }
  }
  if (theta_size_ > 0) order.push_back(b.theta.data());
  return order;
}

}  // namespace selfcal
