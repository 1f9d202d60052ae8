// Uniform quintic B-spline of a vector in time, fitted by least squares.
//
// x(t) = sum_j B_j(t) c_j with control points c_j; at each instant six of the
// basis functions B_j are not zero. x has four continuous derivatives.
// Source: de Boor, "A Practical Guide to Splines" (1978).
#pragma once

#include <Eigen/Core>
#include <vector>

namespace selfcal {

class BSpline {
 public:
  // Value and derivatives with respect to time.
  struct Sample {
    Eigen::VectorXd x, d1, d2;
  };

  // Fits rows of `values` (one for each time, at least one) at times in [0,
  // duration_s], not decreasing. Knots are about spacing_s apart, so that they
  // divide the duration. The fit minimises the squared distances, plus a small
  // multiple of the squared third differences of the control points, which
  // determines the spline where data is missing, as in a gap.
  BSpline(const std::vector<double>& times_s,
          const Eigen::MatrixXd& values,
          double duration_s,
          double spacing_s);

  // 0 <= t_s <= duration_s.
  Sample At(double t_s) const;

 private:
  static constexpr int kOrder = 6;
  using Weights = Eigen::Matrix<double, kOrder, 1>;

  // First control point, and weights of it and the following ones for x, d1 and
  // d2.
  struct Basis {
    Eigen::Index first;
    Weights b0, b1, b2;
  };
  Basis BasisAt(double t_s) const;

  Eigen::Index intervals_;
  double spacing_s_;
  Eigen::MatrixXd control_;  // a row for each control point
};

}  // namespace selfcal
