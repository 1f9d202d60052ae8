#include "core/calibration/ceres_solver.h"

#include <ceres/ceres.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <memory>
#include <utility>

#include "core/calibration/chain_thetas.h"
#include "core/factor/ceres_factors.h"
#include "core/factor/link_batch.h"
#include "core/model/second_imu.h"
#include "core/model/symmetric_eigen.h"

namespace selfcal {
namespace {

// The double arrays that Ceres modifies, one set for each keyframe.
struct KeyframeBlocks {
  std::array<double, 4> q;  // x, y, z, w
  std::array<double, 3> p;
  // Velocity and biases of each IMU.
  std::array<std::array<double, 9>, kMaxImus> vb;
};

KeyframeBlocks ToBlocks(const KeyframeState& x) {
  KeyframeBlocks blocks;
  Eigen::Map<Eigen::Vector4d>(blocks.q.data()) = x.q_GI.coeffs();
  Eigen::Map<Eigen::Vector3d>(blocks.p.data()) = x.p_GI;
  using Motion = Eigen::Map<Eigen::Matrix<double, 9, 1>>;
  Motion(blocks.vb[0].data()) << x.v_GI, x.b_a, x.b_g;
  Motion(blocks.vb[1].data()) << x.v_GJ, x.b_a1, x.b_g1;
  return blocks;
}

void FromBlocks(const KeyframeBlocks& blocks, KeyframeState* x) {
  x->q_GI.coeffs() = Eigen::Map<const Eigen::Vector4d>(blocks.q.data());
  x->q_GI.normalize();
  x->p_GI = Eigen::Map<const Eigen::Vector3d>(blocks.p.data());
  using Motion = Eigen::Map<const Eigen::Matrix3d>;
  const Motion vb(blocks.vb[0].data());
  x->v_GI = vb.col(0);
  x->b_a = vb.col(1);
  x->b_g = vb.col(2);
  const Motion vb1(blocks.vb[1].data());
  x->v_GJ = vb1.col(0);
  x->b_a1 = vb1.col(1);
  x->b_g1 = vb1.col(2);
}

// rho'' is set to zero, so that Ceres weights residuals as in iteratively
// reweighted least squares, as it does for every concave loss.
class CeresLoss final : public ceres::LossFunction {
 public:
  CeresLoss(const RobustLoss& loss, double weight)
      : loss_(loss), weight_(weight) {}

  void Evaluate(double s, double rho[3]) const override {
    rho[0] = weight_ * loss_.Value(s);
    rho[1] = weight_ * loss_.Weight(s);
    rho[2] = 0;
  }

 private:
  RobustLoss loss_;
  double weight_;
};

// W with W^T W = information, which may be singular.
Eigen::MatrixXd PriorWeights(const Rig& rig,
                             const Eigen::MatrixXd& information) {
  const Eigen::VectorXd sigmas = PriorSigmas(rig);
  const SymmetricEigen eigen(sigmas.asDiagonal() * information *
                             sigmas.asDiagonal());
  return eigen.eigenvalues().cwiseMax(0).cwiseSqrt().asDiagonal() *
         eigen.eigenvectors().transpose() * sigmas.cwiseInverse().asDiagonal();
}

// The Ceres problem of one round, with the memory it works on.
class Builder {
 public:
  Builder(const SolverRound& round,
          const CalibrationEstimate& estimate,
          const std::vector<ScreenedLandmark>& landmarks)
      : round_(round),
        thetas_(round.reference, round.problem),
        imus_(ImuCount(round.reference)),
        d_(estimate.d),
        rotation_(MakeRotationManifold()),
        gauge_(MakeGaugeRotationManifold()),
        problem_(ProblemOptions()) {
    for (const KeyframeState& x : estimate.keyframes) {
      keyframes_.push_back(ToBlocks(x));
    }
    for (const ScreenedLandmark& landmark : landmarks) {
      positions_.push_back(landmark.position.inverse_depth);
    }
    AddTheta();
    AddKeyframes();
    AddLinks();
    AddLandmarks(landmarks);
  }

  ceres::Problem* problem() { return &problem_; }
  const Eigen::VectorXd& d() const { return d_; }

  // Landmarks are eliminated first, each separately.
  std::shared_ptr<ceres::ParameterBlockOrdering> Ordering() {
    auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
    for (Eigen::Vector3d& position : positions_) {
      ordering->AddElementToGroup(position.data(), 0);
    }
    for (KeyframeBlocks& x : keyframes_) {
      ordering->AddElementToGroup(x.q.data(), 1);
      ordering->AddElementToGroup(x.p.data(), 1);
      for (int imu = 0; imu < imus_; ++imu) {
        ordering->AddElementToGroup(x.vb[imu].data(), 1);
      }
    }
    ordering->AddElementToGroup(d_.data(), 2);
    return ordering;
  }

  void Read(CalibrationEstimate* estimate,
            std::vector<ScreenedLandmark>* landmarks) const {
    estimate->d = d_;
    for (std::size_t k = 0; k < keyframes_.size(); ++k) {
      FromBlocks(keyframes_[k], &estimate->keyframes[k]);
    }
    for (std::size_t i = 0; i < positions_.size(); ++i) {
      (*landmarks)[i].position.inverse_depth = positions_[i];
    }
  }

 private:
  static ceres::Problem::Options ProblemOptions() {
    ceres::Problem::Options options;
    // Losses and manifolds are shared between blocks and owned here.
    options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    options.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    return options;
  }

  void AddTheta() {
    problem_.AddParameterBlock(d_.data(), static_cast<int>(d_.size()));
    if (round_.basis.cols() == 0) {
      problem_.SetParameterBlockConstant(d_.data());
    } else {
      subspace_ = MakeSubspaceManifold(round_.basis);
      problem_.SetManifold(d_.data(), subspace_.get());
    }
    if (round_.prior_information == nullptr) {
      return;
    }
    const Eigen::MatrixXd weights =
        PriorWeights(round_.rig, *round_.prior_information);
    problem_.AddResidualBlock(
        MakePriorCost(weights, Eigen::VectorXd::Zero(d_.size())).release(),
        nullptr,
        d_.data());
  }

  void AddKeyframes() {
    for (KeyframeBlocks& x : keyframes_) {
      problem_.AddParameterBlock(x.q.data(), 4, rotation_.get());
      problem_.AddParameterBlock(x.p.data(), 3);
      for (int imu = 0; imu < imus_; ++imu) {
        problem_.AddParameterBlock(x.vb[imu].data(), 9);
      }
    }
    for (const int k : round_.problem.gauge_keyframes) {
      problem_.SetManifold(keyframes_[k].q.data(), gauge_.get());
      problem_.SetParameterBlockConstant(keyframes_[k].p.data());
    }
  }

  void AddLinks() {
    const std::vector<InertialLink>& links = round_.problem.inertial_links;
    for (std::size_t i = 0; i < links.size(); ++i) {
      KeyframeBlocks& a = keyframes_[links[i].before];
      KeyframeBlocks& b = keyframes_[links[i].after];
      const auto& states = round_.problem.keyframes;
      const int chain = thetas_.IndexOf(links[i].before);
      const int imu = links[i].imu;
      problem_.AddResidualBlock(
          ByTheta(chain,
                  MakeInertialCost(thetas_[chain],
                                   imu,
                                   links[i].samples,
                                   states[links[i].before].t_ns,
                                   states[links[i].after].t_ns,
                                   NoiseOfImu(round_.rig, imu),
                                   round_.rig.gravity_mps2,
                                   round_.whitening[i]))
              .release(),
          nullptr,
          d_.data(),
          a.q.data(),
          a.p.data(),
          a.vb[imu].data(),
          b.q.data(),
          b.p.data(),
          b.vb[imu].data());
    }
    for (const BiasLink& link : round_.problem.bias_links) {
      problem_.AddResidualBlock(MakeBiasWalkCost(link.sigmas).release(),
                                nullptr,
                                keyframes_[link.before].vb[0].data(),
                                keyframes_[link.after].vb[0].data());
    }
  }

  void AddLandmarks(const std::vector<ScreenedLandmark>& landmarks) {
    // Two rows, as for all other residuals of a landmark: Ceres' elimination is
    // faster with uniform sizes.
    Eigen::Matrix<double, 2, 3> far = Eigen::Matrix<double, 2, 3>::Zero();
    for (std::size_t i = 0; i < landmarks.size(); ++i) {
      far(0, 2) = std::sqrt(landmarks[i].weight) / kInverseDepthSigma;
      problem_.AddResidualBlock(
          MakePriorCost(far, Eigen::Vector3d::Zero()).release(),
          nullptr,
          positions_[i].data());
      const Track& track = round_.problem.tracks[landmarks[i].track];
      for (const UsedObservation& used : landmarks[i].used) {
        const TrackObservation& seen = track.observations[used.index];
        losses_.emplace_back(round_.loss, landmarks[i].weight * used.weight);
        const int chain = thetas_.IndexOf(seen.keyframe);
        problem_.AddResidualBlock(
            ByTheta(chain,
                    MakeReprojectionCost(
                        thetas_[chain],
                        seen.camera,
                        seen.z_px,
                        round_.rig.pixel_sigma_px,
                        landmarks[i].position.anchor,
                        round_.motions.At(seen.keyframe, seen.camera)))
                .release(),
            &losses_.back(),
            d_.data(),
            keyframes_[seen.keyframe].q.data(),
            keyframes_[seen.keyframe].p.data(),
            positions_[i].data());
      }
    }
  }

  // Turns a factor about the theta of a chain into one about theta.
  std::unique_ptr<ceres::CostFunction> ByTheta(
      int chain, std::unique_ptr<ceres::CostFunction> cost) const {
    if (thetas_.Derivative(chain) == nullptr) return cost;
    return MakeTemperatureCost(round_.reference,
                               round_.problem.chain_temperatures_c[chain],
                               std::move(cost));
  }

  const SolverRound& round_;
  const ChainThetas thetas_;  // at the reference
  const int imus_;
  Eigen::VectorXd d_;
  std::vector<KeyframeBlocks> keyframes_;
  std::vector<Eigen::Vector3d> positions_;
  std::unique_ptr<ceres::Manifold> rotation_;
  std::unique_ptr<ceres::Manifold> gauge_;
  std::unique_ptr<ceres::Manifold> subspace_;
  // One for each observation. Ceres keeps pointers to them.
  std::deque<CeresLoss> losses_;
  ceres::Problem problem_;
};

class ProgressAdapter final : public ceres::IterationCallback {
 public:
  ProgressAdapter(const SolverCallback& callback, const Eigen::VectorXd& d)
      : callback_(callback), d_(d) {}

  ceres::CallbackReturnType operator()(
      const ceres::IterationSummary& summary) override {
    switch (callback_(summary.iteration, summary.cost, d_)) {
      case SolverSignal::kEnough:
        return ceres::SOLVER_TERMINATE_SUCCESSFULLY;
      case SolverSignal::kCancel:
        return ceres::SOLVER_ABORT;
      case SolverSignal::kGoOn:
        break;
    }
    return ceres::SOLVER_CONTINUE;
  }

 private:
  const SolverCallback& callback_;
  const Eigen::VectorXd& d_;
};

ceres::Solver::Options SolverOptions(const SolverRound& round) {
  ceres::Solver::Options options;
  // Powell's dogleg rather than Levenberg-Marquardt: on recordings with heavy
  // tails the residuals' own curvature doubles that of Gauss-Newton along the
  // weakest directions (tilt, scale, biases). A full step then overshoots, and
  // the damping that prevents this slows down every weak direction: 100
  // iterations and more, where dogleg, which shortens the step, takes 10.
  options.trust_region_strategy_type = ceres::DOGLEG;
  options.dogleg_type = ceres::TRADITIONAL_DOGLEG;
  options.linear_solver_type = ceres::SPARSE_SCHUR;
  options.num_threads = std::max(1, round.threads);
  options.max_num_iterations = round.max_iterations;
  options.function_tolerance = round.function_tolerance;
  // Convergence is decided by the cost and by the Gauss-Newton step of theta; a
  // small step of all parameters together is not a criterion.
  options.parameter_tolerance = 1e-16;
  options.gradient_tolerance = 1e-16;
  options.jacobi_scaling = true;
  options.update_state_every_iteration = true;
  options.logging_type = ceres::SILENT;
  return options;
}

}  // namespace

SolverOutcome SolveRoundByCeres(const SolverRound& round,
                                const SolverCallback& callback,
                                CalibrationEstimate* estimate,
                                std::vector<ScreenedLandmark>* landmarks) {
  Builder builder(round, *estimate, *landmarks);
  ceres::Solver::Options options = SolverOptions(round);
  options.linear_solver_ordering = builder.Ordering();
  ProgressAdapter adapter(callback, builder.d());
  options.callbacks.push_back(&adapter);

  ceres::Solver::Summary summary;
  ceres::Solve(options, builder.problem(), &summary);
  builder.Read(estimate, landmarks);

  SolverOutcome outcome;
  outcome.iterations =
      std::max(0, static_cast<int>(summary.iterations.size()) - 1);
  outcome.initial_cost = summary.initial_cost;
  outcome.final_cost = summary.final_cost;
  outcome.message = summary.message;
  switch (summary.termination_type) {
    case ceres::CONVERGENCE:
    case ceres::USER_SUCCESS:
      outcome.status = SolverStatus::kConverged;
      break;
    case ceres::NO_CONVERGENCE:
      outcome.status = SolverStatus::kNotConverged;
      break;
    case ceres::USER_FAILURE:
      outcome.status = SolverStatus::kCancelled;
      break;
    case ceres::FAILURE:
      outcome.status = SolverStatus::kFailed;
      break;
  }
  return outcome;
}

}  // namespace selfcal
