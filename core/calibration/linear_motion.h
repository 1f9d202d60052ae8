// Inertial factors of a linear system, and the priors of its keyframes.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "core/calibration/linear_point.h"
#include "core/elimination/chain_unknowns.h"
#include "core/factor/inertial_batch.h"

namespace selfcal {

// The links between keyframes that are connected by IMU samples, linearised. A
// keyframe has at most one link to the next.
class LinearMotion {
 public:
  explicit LinearMotion(VectorWidth width) : inertial_(width) {}

  // `roots`: the noise of each inertial link of the problem.
  void Linearise(const LinearPoint& point,
                 std::span<const InertialNoiseRoot> roots);

  int links() const { return static_cast<int>(places_.size()); }
  int keyframes() const { return static_cast<int>(link_after_.size()); }
  // Index of the link between a keyframe and the next, which must exist.
  int LinkAfter(int keyframe) const { return link_after_[keyframe]; }
  InertialTransition transition(int link) const {
    const Place& place = places_[link];
    return transitions_[place.theta][place.index];
  }
  // Sum of all squared whitened residuals.
  double Squares() const;

 private:
  // A link, by its theta_s and its index among the links with the same.
  struct Place {
    int theta;
    int index;
  };

  InertialBatch inertial_;
  std::vector<InertialLinkStates> states_;
  std::vector<InertialNoiseRoot> roots_;
  std::vector<Place> places_;                     // by link
  std::vector<InertialTransitions> transitions_;  // by theta
  std::vector<int> link_after_;
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
