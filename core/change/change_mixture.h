// The theta of the newest segment of a device that may have changed among its
// segments: a mixture of no change and of every course of one that is tried.
//
// A test that finds no change leaves it possible: too small to be noticed, or
// too recent. An estimate that takes theta for constant is then off by a part
// of the change, and does not say so. Here each course has a weight, its prior
// times how probable it makes what the segments show, and from all of them
// follow mean and covariance of theta now. Where nothing hints at a change, its
// courses are improbable and what they add is small; where a change is nearly
// certain, the mean follows it.
//
// Pure, deterministic, any thread.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace selfcal {

// To be added to an estimate that takes theta for constant.
struct ChangeDoubt {
  double probability = 0;      // that it changed, given what was shown
  Eigen::VectorXd step;        // of the mean
  Eigen::MatrixXd covariance;  // of theta about the new mean, beyond its own
};

class ChangeMixture {
 public:
  // A change y, of which L and s are the information and any of kChangeSizes is
  // the size; theta now is off by `by_change` y. `prior` is its probability
  // before L and s are seen; of all together below 1: the rest is that of no
  // change.
  void Add(const Eigen::MatrixXd& L,
           const Eigen::VectorXd& s,
           Eigen::MatrixXd by_change,
           double prior);

  // Something must have been added.
  ChangeDoubt Doubt() const;

 private:
  struct Hypothesis {
    double log_weight = 0;
    Eigen::MatrixXd by_change;  // D x k
    Eigen::VectorXd mean;       // of y
    Eigen::MatrixXd covariance;
  };
  double no_change_ = 1;  // its prior
  std::vector<Hypothesis> hypotheses_;
};

}  // namespace selfcal
