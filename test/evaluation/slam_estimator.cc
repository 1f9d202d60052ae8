#include "test/evaluation/slam_estimator.h"

#include <ceres/loss_function.h>
#include <ceres/problem.h>
#include <ceres/solver.h>

#include <algorithm>
#include <map>
#include <stdexcept>

#include "core/factor/ceres_factors.h"
#include "core/factor/inertial.h"
#include "core/information/weak_priors.h"

namespace selfcal {
namespace {

constexpr double kHuber_sigmas = 2;

// Parameter blocks of ceres_factors.h for one keyframe.
struct StateBlocks {
  Eigen::Vector4d q;
  Eigen::Vector3d p;
  Eigen::Matrix<double, 9, 1> vb;
};

// Consecutive segments that are estimated together.
class Stretch {
 public:
  Stretch(const Rig& rig,
          const Calibration& theta,
          const SlamEstimatorOptions& options)
      : rig_(rig),
        theta_(theta),
        options_(options),
        offset_(static_cast<std::size_t>(TangentSize(theta)), 0.0) {}

  void Estimate(std::span<MotionSegment> segments) {
    Collect(segments);
    ceres::Problem problem;
    AddKeyframes(&problem);
    AddInertial(segments, &problem);
    AddLandmarks(segments, &problem);
    problem.SetParameterBlockConstant(offset_.data());
    ceres::Solver::Options options;
    options.linear_solver_type = ceres::SPARSE_SCHUR;
    options.max_num_iterations = options_.max_iterations;
    options.function_tolerance = 1e-5;
    options.num_threads = 1;
    options.logging_type = ceres::SILENT;
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem, &summary);
    if (!summary.IsSolutionUsable()) {
      throw std::runtime_error("the SLAM estimator failed: " + summary.message);
    }
    Return(segments);
  }

 private:
  void Collect(std::span<const MotionSegment> segments) {
    states_.clear();
    landmarks_.clear();
    for (const MotionSegment& segment : segments) {
      for (const KeyframeState& x : segment.keyframes) {
        StateBlocks& blocks = states_.emplace_back();
        blocks.q = x.q_GI.coeffs();
        blocks.p = x.p_GI;
        blocks.vb << x.v_GI, x.b_a, x.b_g;
      }
      for (const Landmark& landmark : segment.landmarks) {
        landmarks_.emplace(landmark.id, landmark.p_G);
      }
    }
  }

  void AddKeyframes(ceres::Problem* problem) {
    for (std::size_t k = 0; k < states_.size(); ++k) {
      problem->AddParameterBlock(
          states_[k].q.data(),
          4,
          (k == 0 ? MakeGaugeRotationManifold() : MakeRotationManifold())
              .release());
      problem->AddParameterBlock(states_[k].p.data(), 3);
    }
    problem->SetParameterBlockConstant(states_.front().p.data());
    Eigen::VectorXd sigmas(9);
    sigmas << Eigen::Vector3d::Constant(kVelocityPriorSigma_mps),
        Eigen::Vector3d::Constant(kAccelBiasPriorSigma_mps2),
        Eigen::Vector3d::Constant(kGyroBiasPriorSigma_radps);
    AddPrior(sigmas, states_.front().vb.data(), problem);
  }

  static void AddPrior(const Eigen::VectorXd& sigmas,
                       double* block,
                       ceres::Problem* problem) {
    const Eigen::MatrixXd root = sigmas.cwiseInverse().asDiagonal();
    const Eigen::VectorXd mean =
        Eigen::Map<const Eigen::VectorXd>(block, sigmas.size());
    problem->AddResidualBlock(
        MakePriorCost(root, mean).release(), nullptr, block);
  }

  void AddInertial(std::span<const MotionSegment> segments,
                   ceres::Problem* problem) {
    std::size_t first = 0;
    for (std::size_t s = 0; s < segments.size(); ++s) {
      const MotionSegment& segment = segments[s];
      std::vector<KeyframeState> states = segment.keyframes;
      if (s + 1 < segments.size()) {
        states.push_back(segments[s + 1].keyframes.front());
      }
      for (std::size_t k = 0; k + 1 < states.size(); ++k) {
        AddLink(segment.imu,
                states[k],
                states[k + 1],
                &states_[first + k],
                &states_[first + k + 1],
                problem);
      }
      first += segment.keyframes.size();
    }
  }

  void AddLink(const std::vector<ImuSample>& imu,
               const KeyframeState& x0,
               const KeyframeState& x1,
               StateBlocks* from,
               StateBlocks* to,
               ceres::Problem* problem) {
    InertialMatrix covariance;
    EvaluateInertial(imu,
                     x0,
                     x1,
                     theta_.imu,
                     rig_.imu_noise,
                     rig_.gravity_mps2,
                     nullptr,
                     &covariance);
    problem->AddResidualBlock(
        MakeInertialCost(theta_,
                         0,
                         imu,
                         x0.t_ns,
                         x1.t_ns,
                         rig_.imu_noise,
                         rig_.gravity_mps2,
                         SquareRootInformation(covariance))
            .release(),
        nullptr,
        offset_.data(),
        from->q.data(),
        from->p.data(),
        from->vb.data(),
        to->q.data(),
        to->p.data(),
        to->vb.data());
  }

  void AddLandmarks(std::span<const MotionSegment> segments,
                    ceres::Problem* problem) {
    std::size_t first = 0;
    std::map<std::uint64_t, std::size_t> seen_by;  // first keyframe
    for (const MotionSegment& segment : segments) {
      for (const Observation& o : segment.observations) {
        const std::uint64_t id = segment.landmarks[o.landmark].id;
        const std::size_t k = first + static_cast<std::size_t>(o.keyframe);
        seen_by.emplace(id, k);
        problem->AddResidualBlock(
            MakeReprojectionCost(
                theta_, o.camera, o.z_px, rig_.pixel_sigma_px, std::nullopt)
                .release(),
            new ceres::HuberLoss(kHuber_sigmas),
            offset_.data(),
            states_[k].q.data(),
            states_[k].p.data(),
            landmarks_.at(id).data());
      }
      first += segment.keyframes.size();
    }
    for (const auto& [id, k] : seen_by) {
      Eigen::Vector3d& p_G = landmarks_.at(id);
      const double sigma_m =
          options_.landmark_sigma_relative * (p_G - states_[k].p).norm();
      AddPrior(Eigen::Vector3d::Constant(sigma_m), p_G.data(), problem);
    }
  }

  void Return(std::span<MotionSegment> segments) const {
    auto blocks = states_.begin();
    for (MotionSegment& segment : segments) {
      for (KeyframeState& x : segment.keyframes) {
        x.q_GI = Eigen::Quaterniond(blocks->q).normalized();
        x.p_GI = blocks->p;
        x.v_GI = blocks->vb.segment<3>(0);
        x.b_a = blocks->vb.segment<3>(3);
        x.b_g = blocks->vb.segment<3>(6);
        ++blocks;
      }
      for (Landmark& landmark : segment.landmarks) {
        landmark.p_G = landmarks_.at(landmark.id);
      }
    }
  }

  const Rig& rig_;
  const Calibration& theta_;
  const SlamEstimatorOptions& options_;
  std::vector<double> offset_;  // of theta, zero
  std::vector<StateBlocks> states_;
  std::map<std::uint64_t, Eigen::Vector3d> landmarks_;
};

}  // namespace

std::vector<MotionSegment> EstimateStates(
    const Rig& rig,
    const Calibration& theta_slam,
    const std::vector<MotionSegment>& session,
    const SlamEstimatorOptions& options) {
  std::vector<MotionSegment> estimated = session;
  Stretch stretch(rig, theta_slam, options);
  const auto length = static_cast<std::size_t>(std::max(options.stretch, 1));
  for (std::size_t begin = 0; begin < estimated.size(); begin += length) {
    const std::size_t count = std::min(length, estimated.size() - begin);
    stretch.Estimate(std::span(estimated).subspan(begin, count));
  }
  return estimated;
}

}  // namespace selfcal
