// Posterior of a linear system by kind of factor.
#include <cmath>
#include <span>

#include "core/calibration/linear_system.h"

namespace selfcal {
namespace {

// Selects the parameters at the indices `at`, after the first `head`.
Eigen::MatrixXd Select(const Eigen::MatrixXd& covariance,
                       Eigen::Index head,
                       std::span<const int> at) {
  std::vector<Eigen::Index> indices;
  for (Eigen::Index i = 0; i < head; ++i) indices.push_back(i);
  for (const int i : at) indices.push_back(head + i);
  return covariance(indices, indices);
}

}  // namespace

// Covariance of theta and the interface.
Eigen::MatrixXd LinearSystem::SharedCovariance(
    const Eigen::MatrixXd& theta_covariance) const {
  if (interface_size_ == 0) return theta_covariance;
  const Eigen::Index D = theta_covariance.rows();
  Eigen::MatrixXd covariance(D + interface_size_, D + interface_size_);
  const Eigen::MatrixXd by_theta = interface_root_.solve(interface_theta_);
  const Eigen::MatrixXd with_theta = -by_theta * theta_covariance;
  covariance << theta_covariance, with_theta.transpose(), with_theta,
      interface_root_.solve(
          Eigen::MatrixXd::Identity(interface_size_, interface_size_)) -
          with_theta * by_theta.transpose();
  return covariance;
}

// Half of a walk: six rows between the biases of a keyframe and kept unknowns.
void LinearSystem::AddWalk(const Chain::Walk& walk,
                           const ChainStateVector& step,
                           const ChainStateMatrix& covariance,
                           const Eigen::MatrixXd& with_shared,
                           const Eigen::VectorXd& shared_step,
                           const Eigen::MatrixXd& shared_covariance,
                           LinearPosterior* posterior) const {
  if (walk.link == kNone) return;
  posterior->walk_rows += 6;
  const Eigen::Index first = information_.eta.size() + walk.kept;
  for (int m = 0; m < 6; ++m) {
    const Eigen::Index bias = kStateAccelBias + m, kept = first + m;
    const double a = walk.rows.by_bias[m], b = walk.rows.by_kept[m];
    const double residual =
        a * step[bias] + b * shared_step[kept] + walk.rows.residual[m];
    posterior->walk_squares[m] += residual * residual;
    posterior->walk_redundancy[m] +=
        1 -
        (a * a * covariance(bias, bias) + 2 * a * b * with_shared(bias, kept) +
         b * b * shared_covariance(kept, kept));
  }
}

// The absorbed squares of a row of weight w have the weight w, and rows share
// the absorbed part in proportion to their weights: sum w^2 / sum w on average.
void LinearSystem::AddLandmarks(const std::vector<ScreenedLandmark>& landmarks,
                                LinearPosterior* posterior) const {
  double all_squared = 0;
  for (std::size_t m = 0; m < landmarks.size(); ++m) {
    double shares = 0, squared = 0;
    for (int i = seen_begin_[m]; i < seen_begin_[m + 1]; ++i) {
      const Seen& seen = seen_[i];
      if (seen.factor == kNone) continue;
      posterior->pixel_squares += seen.square;
      shares += seen.share;
      squared += seen.share * seen.share;
      ++posterior->observations;
    }
    if (shares == 0) continue;
    const double rho = places_[m].inverse_depth.z() / kInverseDepthSigma;
    posterior->pixel_squares += landmarks[m].weight * rho * rho;
    posterior->weighted_observations += shares;
    posterior->landmark_weights += squared / shares;
    ++posterior->landmarks;
    all_squared += squared;
  }
  if (posterior->observations > 0) {
    posterior->weight_of_absorbed =
        all_squared / posterior->weighted_observations;
  }
}

LinearPosterior LinearSystem::FindPosterior(
    const Eigen::VectorXd& theta_step,
    const Eigen::MatrixXd& theta_covariance,
    const std::vector<ScreenedLandmark>& landmarks) const {
  LinearPosterior result;
  result.inertial.resize(links_.size());
  result.inertial_covariance.resize(links_.size());
  result.walk_squares.setZero();
  result.walk_redundancy.setZero();
  AddLandmarks(landmarks, &result);

  const Eigen::Index D = theta_step.size();
  const Eigen::VectorXd interface = InterfaceStep(theta_step);
  const Eigen::MatrixXd covariance = SharedCovariance(theta_covariance);
  double inertial_squares = 0;
  std::vector<ChainStateVector> states;
  std::vector<Eigen::Vector3d> points;
  ChainPosterior of_chain;
  for (const Chain& chain : chains_) {
    Eigen::VectorXd shared(D +
                           static_cast<Eigen::Index>(chain.interface.size()));
    shared << theta_step, interface(chain.interface);
    const Eigen::MatrixXd of_shared = Select(covariance, D, chain.interface);
    chain.elimination.FindSteps(shared, &states, &points);
    chain.elimination.FindPosterior(shared, of_shared, states, &of_chain);
    for (int k = chain.range.begin; k < chain.range.end; ++k) {
      const int i = k - chain.range.begin;
      if (k + 1 < chain.range.end) {
        const int link = inertial_after_[k];
        result.inertial[link] = of_chain.noise[i];
        result.inertial_covariance[link] = of_chain.noise_covariance[i];
        inertial_squares += of_chain.noise[i].squaredNorm();
      }
      if (has_prior_[k]) {
        result.prior_squares += states[i].dot(priors_[k] * states[i]);
        result.prior_absorbed +=
            priors_[k].cwiseProduct(of_chain.state_covariance[i]).sum();
      }
    }
    const auto add = [&](const Chain::Walk& walk, bool last) {
      AddWalk(walk,
              last ? states.back() : states.front(),
              last ? of_chain.state_covariance.back()
                   : of_chain.state_covariance.front(),
              last ? of_chain.last_with_shared : of_chain.first_with_shared,
              shared,
              of_shared,
              &result);
    };
    add(chain.walk_in, false);
    add(chain.walk_out, true);
  }
  // The remaining squares are those of the pixels.
  result.pixel_squares +=
      motion_squares_ - decrease_ -
      theta_step.dot(2 * information_.eta - information_.Lambda * theta_step) -
      inertial_squares - result.walk_squares.sum() - result.prior_squares;
  result.unknowns = kChainStateSize * static_cast<int>(inertial_after_.size()) +
                    3 * result.landmarks + result.walk_rows / 2;
  return result;
}

}  // namespace selfcal
