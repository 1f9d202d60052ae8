// Inertial factors of a linear system, and the priors of its keyframes.
#pragma once

#include <Eigen/Core>
#include <array>
#include <span>
#include <vector>

#include "core/calibration/linear_point.h"
#include "core/calibration/linear_posterior.h"
#include "core/elimination/chain_unknowns.h"
#include "core/factor/link_batch.h"

namespace selfcal {

// The links between keyframes that are connected by IMU samples, linearised. A
// keyframe has at most one link to the next.
class LinearMotion {
 public:
  explicit LinearMotion(VectorWidth width) : inertial_(width) {}

  // `roots`: the noise of each inertial link of the problem.
  void Linearise(const LinearPoint& point,
                 std::span<const InertialNoiseRoot> roots);

  // Number of links of all IMUs.
  int links() const { return links_; }
  int keyframes() const { return static_cast<int>(places_.size()); }
  // The factors between a keyframe and the next, which must be connected.
  ChainTransition TransitionAfter(int keyframe) const {
    const Place& place = places_[keyframe];
    return transitions_[place.theta][place.index];
  }
  // Adds the posterior of the noise of that transition, by inertial link of the
  // problem.
  void AddPosterior(int keyframe,
                    const ChainNoiseVector& noise,
                    const ChainNoiseMatrix& covariance,
                    LinearPosterior* posterior) const;
  // Sum of all squared whitened residuals.
  double Squares() const;

 private:
  // The transition after a keyframe: its theta_s, its index among those with
  // the same, and the link of each IMU.
  struct Place {
    int theta = -1;
    int index = -1;
    std::array<int, kMaxImus> links = {};
  };

  LinkBatch inertial_;
  LinksOfImus states_;
  RootsOfImus roots_;
  std::vector<Place> places_;                 // by keyframe
  std::vector<LinkTransitions> transitions_;  // by theta
  int links_ = 0;
};

// Information x^T H x about the step of a keyframe's state, where the factors
// alone may leave it free.
class KeyframePriors {
 public:
  // The weak priors of the score at the beginning of each chain of the problem,
  // with `damping` times the information of small steps; and the gauge.
  void Set(const LinearPoint& point, double damping);

  // Null if the keyframe has none.
  const ChainStateMatrix* Of(int keyframe) const {
    return present_[keyframe] ? &information_[keyframe] : nullptr;
  }

 private:
  std::vector<ChainStateMatrix> information_;
  std::vector<bool> present_;
};

}  // namespace selfcal
