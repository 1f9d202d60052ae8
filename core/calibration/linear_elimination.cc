// Elimination of a linear system, chain by chain and then the interface, and
// back-substitution.
#include <algorithm>
#include <cmath>

#include "core/calibration/linear_system.h"

namespace selfcal {
namespace {

double Information(double sigma) { return 1 / (sigma * sigma); }

// Converts a step of p_G = a + R (alpha, beta, 1) / rho to one of (alpha, beta,
// rho).
Eigen::Vector3d PlaceStep(const LandmarkPlace& place,
                          double rho,
                          const Eigen::Vector3d& step_G) {
  const Eigen::Vector3d q = rho * (place.anchor.R_GA.transpose() * step_G);
  return {q.x() - place.inverse_depth.x() * q.z(),
          q.y() - place.inverse_depth.y() * q.z(),
          -rho * q.z()};
}

}  // namespace

// Prior on inverse depth of landmark_place.h.
LinearSystem::LandmarkPrior LinearSystem::PriorOf(
    const std::vector<ScreenedLandmark>& landmarks, int landmark) const {
  const LandmarkPlace& place = places_[landmark];
  const double rho = place.inverse_depth.z();
  const Eigen::Vector3d rho_by_p = -rho * rho * place.anchor.R_GA.col(2);
  const double information =
      landmarks[landmark].weight * Information(kInverseDepthSigma);
  return {information * rho_by_p * rho_by_p.transpose(),
          information * rho * rho_by_p};
}

void LinearSystem::AddLandmarkPriors(
    const std::vector<ScreenedLandmark>& landmarks, Chain* chain) {
  for (std::size_t m = 0; m < chain->landmarks.size(); ++m) {
    if (chain->kept_landmarks[m] != kNone) continue;
    const LandmarkPrior prior = PriorOf(landmarks, chain->landmarks[m]);
    chain->elimination.AddLandmarkPrior(static_cast<int>(m), prior.H, prior.g);
  }
}

void LinearSystem::EliminateKeyframes(Chain* chain) {
  const auto keep_half = [&](const Chain::Walk& walk) {
    if (walk.link == kNone) return;
    chain->elimination.AddKeptBias(walk.kept, walk.rows);
  };
  for (int k = chain->range.begin; k < chain->range.end; ++k) {
    if (has_prior_[k]) chain->elimination.AddPrior(priors_[k]);
    if (k == chain->range.begin) keep_half(chain->walk_in);
    if (k + 1 == chain->range.end) break;
    chain->elimination.Advance(transitions_[inertial_after_[k]]);
  }
  keep_half(chain->walk_out);
  chain->elimination.Finish(&of_chain_);
}

// Adds the information of a chain about theta and the interface.
void LinearSystem::AddChain(const Chain& chain) {
  const Eigen::Index D = information_.eta.size();
  const Eigen::MatrixXd& Lambda = of_chain_.Lambda;
  const Eigen::VectorXd& eta = of_chain_.eta;
  information_.Lambda += Lambda.topLeftCorner(D, D);
  information_.eta += eta.head(D);
  decrease_ -= of_chain_.constant;
  const std::vector<int>& at = chain.interface;
  for (std::size_t j = 0; j < at.size(); ++j) {
    const Eigen::Index column = D + static_cast<Eigen::Index>(j);
    for (std::size_t i = 0; i < at.size(); ++i) {
      interface_(at[i], at[j]) +=
          Lambda(D + static_cast<Eigen::Index>(i), column);
    }
    interface_theta_.row(at[j]) += Lambda.col(column).head(D).transpose();
    interface_eta_(at[j]) += eta(column);
  }
}

// Eliminates the interface.
void LinearSystem::SolveInterface(
    const std::vector<ScreenedLandmark>& landmarks) {
  if (interface_size_ == 0) return;
  for (std::size_t m = 0; m < interface_of_landmark_.size(); ++m) {
    const int at = interface_of_landmark_[m];
    if (at == kNone) continue;
    const LandmarkPrior prior = PriorOf(landmarks, static_cast<int>(m));
    interface_.block<3, 3>(at, at) += prior.H;
    interface_eta_.segment<3>(at) -= prior.g;
  }
  interface_root_.compute(interface_);
  // The information about the depth of a landmark near infinity may be lost to
  // rounding: it gets the least amount that is distinguishable from none.
  for (double add = 1e-14; interface_root_.info() != Eigen::Success && add < 1;
       add *= 10) {
    interface_.diagonal() *= 1 + add;
    interface_root_.compute(interface_);
  }
  const Eigen::MatrixXd by_theta = interface_root_.solve(interface_theta_);
  const Eigen::VectorXd at_rest = interface_root_.solve(interface_eta_);
  information_.Lambda -= interface_theta_.transpose() * by_theta;
  information_.Lambda =
      (0.5 * (information_.Lambda + information_.Lambda.transpose())).eval();
  information_.eta -= interface_theta_.transpose() * at_rest;
  decrease_ += interface_eta_.dot(at_rest);
}

void LinearSystem::Linearise(const Rig& rig,
                             const Calibration& theta,
                             const CalibrationProblem& problem,
                             const std::vector<KeyframeState>& keyframes,
                             const KeyframeMotions& motions,
                             const std::vector<ScreenedLandmark>& landmarks,
                             std::span<const InertialNoiseRoot> roots,
                             const RobustLoss* loss,
                             double damping) {
  rig_ = &rig;
  theta_ = &theta;
  keyframes_ = &keyframes;
  motions_ = &motions;
  camera_sizes_.clear();
  for (const CameraCalibration& camera : theta.cameras) {
    camera_sizes_.push_back(CameraTangentSize(camera));
  }
  StartChains(problem, static_cast<int>(camera_sizes_.size()), damping);
  PlaceLandmarks(landmarks);
  SortByView(problem, landmarks);
  Weigh(loss);
  interface_size_ = 0;
  FindTracks();
  KeepWalks(problem);

  links_.clear();
  for (const InertialLink& link : problem.inertial_links) {
    links_.push_back(
        {&keyframes[link.before], &keyframes[link.after], link.samples});
  }
  transitions_.resize(links_.size());
  inertial_.LineariseWithRoots(
      links_, theta.imu, rig.gravity_mps2, roots, transitions_);
  decrease_ = 0;
  for (const InertialTransition& transition : transitions_) {
    for (const double r : transition.whitened) decrease_ += r * r;
  }
  motion_squares_ += decrease_;

  const int size = TangentSize(theta);
  information_.Lambda.setZero(size, size);
  information_.eta.setZero(size);
  interface_.setZero(interface_size_, interface_size_);
  interface_theta_.setZero(interface_size_, size);
  interface_eta_.setZero(interface_size_);
  Chain* finished = &chains_.back();  // by the previous linearisation
  for (Chain& chain : chains_) {
    chain.elimination.TakeScratch(&finished->elimination);
    finished = &chain;
    chain.elimination.Start({chain.range.end - chain.range.begin,
                             camera_sizes_,
                             chain.tracks,
                             chain.track_keyframes,
                             static_cast<int>(chain.interface.size()),
                             chain.kept_landmarks},
                            ChainElimination::Record::kSteps);
    AddViews(&chain);
    AddLandmarkPriors(landmarks, &chain);
    EliminateKeyframes(&chain);
    AddChain(chain);
  }
  SolveInterface(landmarks);
}

Eigen::VectorXd LinearSystem::InterfaceStep(
    const Eigen::VectorXd& theta_step) const {
  if (interface_size_ == 0) return Eigen::VectorXd(0);
  return interface_root_.solve(interface_eta_ - interface_theta_ * theta_step);
}

void LinearSystem::FindSteps(const Eigen::VectorXd& theta_step,
                             std::vector<ChainStateVector>* keyframes,
                             std::vector<Eigen::Vector3d>* landmarks) const {
  keyframes->clear();
  landmarks->assign(places_.size(), Eigen::Vector3d::Zero());
  const Eigen::VectorXd interface = InterfaceStep(theta_step);
  Eigen::VectorXd shared;
  std::vector<ChainStateVector> of_chain;
  std::vector<Eigen::Vector3d> points;
  for (const Chain& chain : chains_) {
    const auto kept = static_cast<Eigen::Index>(chain.interface.size());
    shared.resize(theta_step.size() + kept);
    shared << theta_step, interface(chain.interface);
    chain.elimination.FindSteps(shared, &of_chain, &points);
    keyframes->insert(keyframes->end(), of_chain.begin(), of_chain.end());
    for (std::size_t m = 0; m < chain.landmarks.size(); ++m) {
      const LandmarkPlace& place = places_[chain.landmarks[m]];
      (*landmarks)[chain.landmarks[m]] =
          PlaceStep(place, place.inverse_depth.z(), points[m]);
    }
  }
}

}  // namespace selfcal
