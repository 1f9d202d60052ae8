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

// Covariance of (theta_s, others) from that of (theta, others).
Eigen::MatrixXd AtTemperature(const Eigen::MatrixXd& derivative,
                              const Eigen::MatrixXd& covariance) {
  const Eigen::Index others = covariance.rows() - derivative.cols();
  Eigen::MatrixXd whole =
      Eigen::MatrixXd::Zero(derivative.rows() + others, covariance.rows());
  whole.topLeftCorner(derivative.rows(), derivative.cols()) = derivative;
  whole.bottomRightCorner(others, others).setIdentity();
  return whole * covariance * whole.transpose();
}

// Step and covariance of the shared unknowns of a chain, the `head` of theta_s
// first.
struct SharedPosterior {
  Eigen::Index head = 0;
  Eigen::VectorXd step;
  Eigen::MatrixXd covariance;
};

// Half of a walk: six rows between the biases of a keyframe and kept unknowns.
void AddWalk(const HalfWalk& walk,
             const ChainStateVector& step,
             const ChainStateMatrix& covariance,
             const Eigen::MatrixXd& with_shared,
             const SharedPosterior& shared,
             LinearPosterior* posterior) {
  if (walk.kept < 0) return;
  posterior->walk_rows += 6;
  const Eigen::Index first = shared.head + walk.kept;
  for (int m = 0; m < 6; ++m) {
    const Eigen::Index bias = kStateAccelBias + m, kept = first + m;
    const double a = walk.rows.by_bias[m], b = walk.rows.by_kept[m];
    const double residual =
        a * step[bias] + b * shared.step[kept] + walk.rows.residual[m];
    posterior->walk_squares[m] += residual * residual;
    posterior->walk_redundancy[m] +=
        1 -
        (a * a * covariance(bias, bias) + 2 * a * b * with_shared(bias, kept) +
         b * b * shared.covariance(kept, kept));
  }
}

// The absorbed squares of a row of weight w have the weight w, and rows share
// the absorbed part in proportion to their weights: sum w^2 / sum w on average.
void AddLandmarks(const LinearObservations& observations,
                  const std::vector<ScreenedLandmark>& landmarks,
                  LinearPosterior* posterior) {
  double all_squared = 0;
  for (int m = 0; m < observations.landmarks(); ++m) {
    double shares = 0, squared = 0;
    for (const LinearObservation& seen : observations.OfLandmark(m)) {
      if (seen.factor < 0) continue;
      posterior->pixel_squares += seen.square;
      shares += seen.share;
      squared += seen.share * seen.share;
      ++posterior->observations;
    }
    if (shares == 0) continue;
    const double rho =
        observations.position(m).inverse_depth.z() / kInverseDepthSigma;
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

}  // namespace

LinearPosterior LinearSystem::FindPosterior(
    const Eigen::VectorXd& theta_step,
    const Eigen::MatrixXd& theta_covariance,
    const std::vector<ScreenedLandmark>& landmarks) const {
  LinearPosterior result;
  result.inertial.resize(motion_.links());
  result.inertial_covariance.resize(motion_.links());
  result.walk_squares.setZero();
  result.walk_redundancy.setZero();
  AddLandmarks(observations_, landmarks, &result);

  const Eigen::Index D = theta_step.size();
  const Eigen::VectorXd interface = interface_.Step(theta_step);
  const Eigen::MatrixXd covariance = interface_.Covariance(theta_covariance);
  double inertial_squares = 0;
  std::vector<ChainStateVector> states;
  std::vector<Eigen::Vector3d> points;
  ChainPosterior of_chain;
  for (std::size_t c = 0; c < chains_.size(); ++c) {
    const ChainPlan& plan = plan_.chains[c];
    SharedPosterior shared{.head = D,
                           .step = SharedStep(plan, theta_step, interface),
                           .covariance = Select(covariance, D, plan.interface)};
    if (const Eigen::MatrixXd* derivative = DerivativeOf(plan)) {
      shared.head = derivative->rows();
      shared.covariance = AtTemperature(*derivative, shared.covariance);
    }
    chains_[c].FindSteps(shared.step, &states, &points);
    chains_[c].FindPosterior(shared.step, shared.covariance, states, &of_chain);
    for (int k = plan.range.begin; k < plan.range.end; ++k) {
      const int i = k - plan.range.begin;
      if (k + 1 < plan.range.end) {
        motion_.AddPosterior(
            k, of_chain.noise[i], of_chain.noise_covariance[i], &result);
        inertial_squares += of_chain.noise[i].squaredNorm();
      }
      if (const ChainStateMatrix* prior = priors_.Of(k)) {
        result.prior_squares += states[i].dot(*prior * states[i]);
        result.prior_absorbed +=
            prior->cwiseProduct(of_chain.state_covariance[i]).sum();
      }
    }
    AddWalk(plan.walk_in,
            states.front(),
            of_chain.state_covariance.front(),
            of_chain.first_with_shared,
            shared,
            &result);
    AddWalk(plan.walk_out,
            states.back(),
            of_chain.state_covariance.back(),
            of_chain.last_with_shared,
            shared,
            &result);
  }
  // The remaining squares are those of the pixels.
  result.pixel_squares +=
      plan_.walk_squares + motion_.Squares() - decrease_ -
      theta_step.dot(2 * information_.eta - information_.Lambda * theta_step) -
      inertial_squares - result.walk_squares.sum() - result.prior_squares;
  result.unknowns =
      motion_.keyframes() * static_cast<int>(states.front().size()) +
      3 * result.landmarks + result.walk_rows / 2;
  return result;
}

}  // namespace selfcal
