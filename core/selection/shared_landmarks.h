// How far segments count that see the same landmarks.
//
// The errors of the observations of one landmark are not independent from one
// segment to another: a track follows the same patch of the image, and what is
// wrong with the patch is wrong in all of them. How strongly they depend is not
// known, so that information which stands on the same landmark must not be
// added: it is fused by covariance intersection, which is consistent whatever
// the dependence (Julier and Uhlmann 1997), while information on landmarks that
// no other segment sees adds as usual (split covariance intersection, Julier
// and Uhlmann 2001).
//
// Segment i sees landmark m with the share w_im of its observations, and that
// share of its information stands on it. A landmark is allotted to the segments
// that see it in parts a_im >= 0 with sum_i a_im = 1, and the information of a
// set is
//     I + sum_i c_i L_i,   c_i = sum_m a_im w_im,
// with the allotment that makes its determinant largest. So a copy of a
// segment adds nothing, one that shares nothing adds all of its own, and more
// segments never say less.
//
// Pure, deterministic; any thread.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "core/selection/candidate.h"

namespace selfcal {

class SharedLandmarks {
 public:
  // Of these candidates, in their order. They are referred to, not copied.
  explicit SharedLandmarks(std::span<const Candidate* const> candidates);

  // I + sum_i c_i L_i over the members (indices of candidates, distinct). Its
  // 1/2 ln det is within 0.005 nat of the best allotment's.
  Eigen::MatrixXd Information(std::span<const int> members) const;
  // The same with c_i = 1: segments as if they shared nothing.
  Eigen::MatrixXd Sum(std::span<const int> members) const;

 private:
  // The part of a landmark in a candidate's information.
  struct Sight {
    int candidate;
    double share;
  };
  using Sights = std::vector<Sight>;

  Eigen::MatrixXd Weighted(std::span<const int> members,
                           std::span<const double> weights) const;

  std::vector<const Candidate*> candidates_;
  std::vector<double> alone_;   // what each sees that no other candidate does
  std::vector<Sights> shared_;  // one for each landmark seen by several
};

}  // namespace selfcal
