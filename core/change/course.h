// The course of a device change over segments in the order of time, and the
// information of the segments about a change with that course.
//
// A segment of weight w comes from a device whose theta differs by w x, where x
// is the full change: the weight is 0 before the change, 1 after it, and in
// between while it grows. With the error e ~ N(0, Sigma) of the active
// calibration,
//
//   eta_i = Lambda_i (e + w_i x) + noise,   noise ~ N(0, Lambda_i).
//
// The information about x with e eliminated,
//
//   L = L2 - L1 (Sigma^-1 + L0)^-1 L1,   s = h1 - L1 (Sigma^-1 + L0)^-1 h0,
//   Lk = sum w_i^k Lambda_i,             hk = sum w_i^k eta_i,
//
// satisfies s ~ N(L x, L). Segments that were linearised elsewhere additionally
// have the errors of their reach (consistency.h), a + w_i b, both of the same
// size: a is common to segments of one motion, but later segments may have
// another motion, in which other noise looks like information. Both are
// eliminated first. Segments from before the change reduce e: an offset that
// all segments have in common is not a change. A change x = B y within the span
// of B is tested by
//
//   d = (B^T s)^T (B^T L B)^-1 (B^T s),
//
// which is chi-square distributed without a change, with as many degrees as B
// has columns. This is the likelihood ratio of a change of these parameters
// alone: the others keep their known values, which makes the test far sharper
// than the uncertainty of each parameter alone.
//
// Pure, deterministic, callable from any thread.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "core/change/consistency.h"

namespace selfcal {

class Course {
 public:
  // A course without segments about a calibration with Sigma = root root^T;
  // root must outlive it.
  explicit Course(const Eigen::MatrixXd& root) : root_(&root) {}

  void Add(const OffsetInformation& segment, double weight);
  void Remove(const OffsetInformation& segment, double weight);

  // Information (L, s) about x.
  OffsetInformation Change() const;
  // The estimated offset e + w x of a segment of weight w, given x.
  Eigen::VectorXd Offset(const Eigen::VectorXd& x, double weight) const;
  // Derivative of Offset() with respect to x.
  Eigen::MatrixXd OffsetByChange(double weight) const;

 private:
  // Sums over the segments that were linearised at the same point.
  struct Sums {
    Eigen::VectorXd reach;
    Eigen::MatrixXd L0, L1, L2;
    Eigen::VectorXd h0, h1;
  };
  static void EliminateReach(Sums* sums);
  Sums Total() const;  // with the errors of their reach eliminated

  const Eigen::MatrixXd* root_;
  std::vector<Sums> sums_;
};

// Tests d, for B (orthonormal) with directions for which L exceeds the prior.
ConsistencyTest TestSpan(const OffsetInformation& change,
                         const Eigen::MatrixXd& B);

// Weights of the newest `newest` of `count` segments: 1 for all after a step,
// or growing linearly up to 1 at the last for a ramp.
Eigen::VectorXd StepCourse(int count, int newest);
Eigen::VectorXd RampCourse(int count, int newest);

// Sums all segments with their weights.
Course MakeCourse(std::span<const OffsetInformation> segments,
                  const Eigen::VectorXd& weights,
                  const Eigen::MatrixXd& root);

}  // namespace selfcal
