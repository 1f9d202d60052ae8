// Statistics that the experiments share.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <utility>
#include <vector>

namespace selfcal {

// Of at least one value.
double Mean(const std::vector<double>& values);
double Rms(const std::vector<double>& values);
// p in [0, 1], linear between the values in order.
double Quantile(std::vector<double> values, double p);
double MedianOf(const std::vector<double>& values);

// With n - 1; of at least two values.
double StandardDeviation(const std::vector<double>& values);

// Rank correlation of Spearman, in [-1, 1]; ties get their mean rank. At least
// two pairs, not all equal.
double RankCorrelation(const std::vector<double>& a,
                       const std::vector<double>& b);

// Where the distribution function of chi-square with dof > 0 degrees of freedom
// is p, 0 < p < 1.
double ChiSquareQuantile(double p, int dof);

// Normalised squared error (NEES) of the components that are estimated: those
// whose variance is not exactly zero. Whatever the units.
struct SquaredError {
  double nees = 0;
  int dof = 0;
};
SquaredError NormalisedSquaredError(const Eigen::VectorXd& error,
                                    const Eigen::MatrixXd& covariance);

// Probability that at least `count` of `trials` come out, at `rate` in (0, 1)
// each.
double BinomialTail(int count, int trials, double rate);

// The rate at which `count` of `trials`, or fewer, come out with a probability
// of only 1 - probability (Clopper and Pearson 1934); 1 for count = trials.
double BinomialUpperBound(int count, int trials, double probability);

// Bounds within which the mean of `runs` normalised squared errors of dof
// dimensions lies with the given probability, half of the rest on each side,
// if errors are as the covariance says (Bar-Shalom).
std::pair<double, double> NeesBounds(int dof, int runs, double probability);

// The fewest and the most hits in `runs` trials of chance p, 0 < p < 1, that
// leave out less than half of 1 - probability each.
std::pair<int, int> BinomialBounds(int runs, double p, double probability);

// The rotation that minimises the sum of squared chordal distances (Markley,
// Cheng, Crassidis, Oshman 2007): of the sum of q q^T, the eigenvector with the
// largest eigenvalue. At least one; sign of each does not matter.
Eigen::Quaterniond AverageRotation(
    const std::vector<Eigen::Quaterniond>& rotations);

// Standard deviation about the average, as Rodrigues angles (rotation vectors
// Log(mean^T R)): of each axis, and of the angle. With n - 1; at least two.
struct RotationSpread {
  Eigen::Vector3d axes_rad;
  double angle_rad;  // root of the sum of squares
};
RotationSpread SpreadOfRotations(
    const std::vector<Eigen::Quaterniond>& rotations);

}  // namespace selfcal
