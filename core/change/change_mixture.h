// Estimates theta of the newest segment of a device that may have changed among
// its segments: a mixture of the hypotheses of no change and of every tested
// course of a change.
//
// If a test finds no change, a change is still possible: too small to be
// noticed, or too recent. An estimate that assumes a constant theta then has an
// error of a fraction of the change, which its covariance does not contain.
// Here each course has a weight, its prior times the likelihood of the data
// under it, and the mixture gives mean and covariance of the present theta. If
// nothing indicates a change, its courses are improbable and contribute little;
// if a change is nearly certain, the mean follows it.
//
// Pure, deterministic, callable from any thread.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace selfcal {

// Correction of an estimate that assumes a constant theta.
struct ChangeDoubt {
  double probability = 0;  // of a change, given the data
  Eigen::VectorXd step;    // of the mean
  Eigen::MatrixXd
      covariance;  // of theta about the new mean, in addition to its own
};

class ChangeMixture {
 public:
  // Adds the hypothesis of a change y, with information L and s about it and
  // any size of kChangeSizes; the present theta then differs by `by_change` y.
  // `prior` is its probability before L and s are known; the sum over all
  // hypotheses is below 1: the rest is the probability of no change.
  void Add(const Eigen::MatrixXd& L,
           const Eigen::VectorXd& s,
           const Eigen::MatrixXd& by_change,
           double prior);

  // At least one hypothesis must have been added.
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
