#include "core/calibration/linear_system.h"

#include "core/elimination/by_theta.h"

namespace selfcal {

void LinearSystem::ReleaseMemory() {
  chains_.clear();
  chains_.shrink_to_fit();
  observations_ = LinearObservations();
  plan_ = EliminationPlan();
}

void LinearSystem::EliminateChain(const LinearPoint& point,
                                  const ChainPlan& plan,
                                  ChainElimination* elimination,
                                  SharedInformation* result) {
  const Calibration& theta = point.thetas.OfKeyframe(plan.range.begin);
  std::vector<LandmarkRows> cameras;
  for (const CameraCalibration& camera : theta.cameras) {
    cameras.push_back(RowsOf(camera));
  }
  elimination->Start(plan.Shape(theta, cameras),
                     ChainElimination::Record::kSteps);
  const KeyframeChain& range = plan.range;
  for (int k = range.begin; k < range.end; ++k) {
    views_.AddKeyframe(point, observations_, k, range.begin, elimination);
  }
  for (std::size_t m = 0; m < plan.landmarks.size(); ++m) {
    if (plan.kept_landmarks[m] >= 0) continue;
    const int landmark = plan.landmarks[m];
    const LandmarkPrior prior = InverseDepthPrior(
        observations_.position(landmark), point.landmarks[landmark].weight);
    elimination->AddLandmarkPrior(static_cast<int>(m), prior.H, prior.g);
  }

  const auto add_half = [&](const HalfWalk& walk) {
    if (walk.kept >= 0) elimination->AddKeptBias(walk.kept, walk.rows);
  };
  for (int k = range.begin; k < range.end; ++k) {
    if (const ChainStateMatrix* prior = priors_.Of(k)) {
      elimination->AddPrior(*prior);
    }
    if (k == range.begin) add_half(plan.walk_in);
    if (k + 1 == range.end) break;
    elimination->Advance(motion_.TransitionAfter(k));
  }
  add_half(plan.walk_out);
  elimination->Finish(result);
  if (const Eigen::MatrixXd* derivative = DerivativeOf(plan)) {
    *result = ByTheta(*derivative, *result);
  }
}

const Eigen::MatrixXd* LinearSystem::DerivativeOf(const ChainPlan& plan) const {
  return derivatives_.empty() ? nullptr : &derivatives_[plan.theta];
}

Eigen::VectorXd LinearSystem::SharedStep(
    const ChainPlan& plan,
    const Eigen::VectorXd& theta_step,
    const Eigen::VectorXd& interface_step) const {
  const Eigen::MatrixXd* derivative = DerivativeOf(plan);
  const Eigen::VectorXd chain_step =
      derivative != nullptr ? *derivative * theta_step : theta_step;
  Eigen::VectorXd shared(chain_step.size() +
                         static_cast<Eigen::Index>(plan.interface.size()));
  shared << chain_step, interface_step(plan.interface);
  return shared;
}

void LinearSystem::Linearise(const LinearPoint& point,
                             std::span<const InertialNoiseRoot> roots,
                             const RobustLoss* loss,
                             double damping) {
  observations_.Collect(point);
  views_.Weigh(point, loss, &observations_);
  PlanElimination(point, &observations_, &plan_);
  motion_.Linearise(point, roots);
  priors_.Set(point, damping);

  derivatives_.clear();
  for (int t = 0; t < point.thetas.size(); ++t) {
    if (const Eigen::MatrixXd* by_theta = point.thetas.Derivative(t)) {
      derivatives_.push_back(*by_theta);
    }
  }
  const Eigen::Index size = derivatives_.empty() ? TangentSize(point.thetas[0])
                                                 : derivatives_.front().cols();
  information_.Lambda.setZero(size, size);
  information_.eta.setZero(size);
  interface_.Start(plan_.interface_size, static_cast<int>(size));
  decrease_ = motion_.Squares();

  const std::size_t chains = plan_.chains.size();
  while (chains_.size() < chains) chains_.emplace_back(width_);
  chains_.erase(chains_.begin() + static_cast<std::ptrdiff_t>(chains),
                chains_.end());
  ChainElimination* finished = &chains_.back();  // by the last linearisation
  SharedInformation of_chain;
  for (std::size_t c = 0; c < chains; ++c) {
    chains_[c].TakeScratch(finished);
    finished = &chains_[c];
    EliminateChain(point, plan_.chains[c], &chains_[c], &of_chain);
    interface_.Add(of_chain, plan_.chains[c].interface, &information_);
    decrease_ -= of_chain.constant;
  }
  for (int m = 0; m < observations_.landmarks(); ++m) {
    const int at = plan_.interface_of_landmark[m];
    if (at < 0) continue;
    interface_.AddLandmarkPrior(at,
                                InverseDepthPrior(observations_.position(m),
                                                  point.landmarks[m].weight));
  }
  decrease_ += interface_.Eliminate(&information_);
}

void LinearSystem::FindSteps(const Eigen::VectorXd& theta_step,
                             std::vector<ChainStateVector>* keyframes,
                             std::vector<Eigen::Vector3d>* landmarks) const {
  keyframes->clear();
  landmarks->assign(observations_.landmarks(), Eigen::Vector3d::Zero());
  const Eigen::VectorXd interface = interface_.Step(theta_step);
  std::vector<ChainStateVector> of_chain;
  std::vector<Eigen::Vector3d> points;
  for (std::size_t c = 0; c < chains_.size(); ++c) {
    const ChainPlan& plan = plan_.chains[c];
    chains_[c].FindSteps(
        SharedStep(plan, theta_step, interface), &of_chain, &points);
    keyframes->insert(keyframes->end(), of_chain.begin(), of_chain.end());
    for (std::size_t m = 0; m < plan.landmarks.size(); ++m) {
      const int landmark = plan.landmarks[m];
      (*landmarks)[landmark] =
          InverseDepthStep(observations_.position(landmark), points[m]);
    }
  }
}

}  // namespace selfcal
