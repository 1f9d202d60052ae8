// The course of a change over segments in the order of time, and what the
// segments say of a change that took it.
//
// A segment of weight w comes from a device whose theta is off by w x, where x
// is the change in full: 0 before it, 1 after it, and in between while it
// grows. With the error e of the active calibration, e ~ N(0, Sigma),
//
//   eta_i = Lambda_i (e + w_i x) + noise,   noise ~ N(0, Lambda_i).
//
// The information about x with e eliminated,
//
//   L = L2 - L1 (Sigma^-1 + L0)^-1 L1,   s = h1 - L1 (Sigma^-1 + L0)^-1 h0,
//   Lk = sum w_i^k Lambda_i,             hk = sum w_i^k eta_i,
//
// has s ~ N(L x, L). Segments that were linearised elsewhere have errors of
// their reach besides (consistency.h), a + w_i b, each as large: those of one
// motion the same, but those that follow may be of another motion, which takes
// other noise for what it shows. Both are eliminated before. Segments from
// before the change make e smaller: whatever all segments have in common is no
// change. A change within the span of B, x = B y, is tested by
//
//   d = (B^T s)^T (B^T L B)^-1 (B^T s),
//
// chi-square distributed without a change, with as many degrees as B has
// columns. This is the likelihood ratio of a change of these parameters alone:
// the others stay as they are known, which makes it far sharper than the
// uncertainty of each parameter by itself.
//
// Pure, deterministic, any thread.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "core/change/consistency.h"

namespace selfcal {

class Course {
 public:
  // Of a calibration with Sigma = root root^T, which must outlive it; without
  // segments.
  explicit Course(const Eigen::MatrixXd& root) : root_(&root) {}

  void Add(const OffsetInformation& segment, double weight);
  void Remove(const OffsetInformation& segment, double weight);

  // (L, s).
  OffsetInformation Change() const;
  // The offset e + w x that all of them show of a segment of weight w, given x.
  Eigen::VectorXd Offset(const Eigen::VectorXd& x, double weight) const;
  // Its derivative by x.
  Eigen::MatrixXd OffsetByChange(double weight) const;

 private:
  // Of the segments that were linearised at one place.
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

// d, for directions of B (orthonormal) of which L says more than the prior.
ConsistencyTest TestSpan(const OffsetInformation& change,
                         const Eigen::MatrixXd& B);

// The weights of the newest `newest` of `count` segments: all after a step, or
// growing evenly up to 1 at the last.
Eigen::VectorXd StepCourse(int count, int newest);
Eigen::VectorXd RampCourse(int count, int newest);

// The sum over all segments with their weights.
Course MakeCourse(std::span<const OffsetInformation> segments,
                  const Eigen::VectorXd& weights,
                  const Eigen::MatrixXd& root);

}  // namespace selfcal
