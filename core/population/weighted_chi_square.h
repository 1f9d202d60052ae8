// The distribution of a weighted sum of squares of independent standard normal
// variables. Pure, callable from any thread.
#pragma once

#include <Eigen/Core>

namespace selfcal {

// Probability that the sum is larger than `statistic`. Weights are at least 0;
// without a positive one the probability is 1. An approximation by a saddle
// point (Kuonen, Biometrika 86, 1999), whose relative error does not grow in
// the tail: at most 12 % for a single square, 6 % for two, 1.2 % for ten.
double WeightedChiSquareTail(double statistic, const Eigen::ArrayXd& weights);

}  // namespace selfcal
