// By what two scores of one segment differ, in figures without units. Pure, any
// thread.
#pragma once

#include "core/information/segment_information.h"
#include "core/model/rig.h"

namespace selfcal {

struct ScoreDifference {
  // Largest of the groups' entropies [nat].
  double entropy_nats = 0;
  // Of the information of theta, prior included: by which part that of the most
  // different direction differs, and so its variance. A group of k components
  // cannot differ by more than k / 2 of it in entropy.
  double information = 0;
  // Of the estimates that follow from them, in their standard deviations, in
  // the most different direction.
  double estimate_sigmas = 0;
  // So much of each is rounding.
  double tolerance = 0;
};

// Infinite where shapes differ, or a number is not finite.
ScoreDifference CompareScores(const Rig& rig,
                              const SegmentInformation& a,
                              const SegmentInformation& b);

// Two computations of one score in double precision differ by rounding: by
// eps = 2.2e-16 times what elimination amplifies it by, the ratio of what a
// factor says about a variable to what is left of it. A landmark keeps along
// its ray 1e-10 of what is known across it (its prior of 1 km), which explains
// 1e-6.
inline constexpr double kScoreTolerance = 1e-6;
// Where a segment does not observe all of theta, a direction is what the weak
// priors leave of the inertial factors: at rest an accelerometer's scale looks
// like its bias, of which the prior (100 m/s^2) knows 1e-12 of what the factors
// tell.
inline constexpr double kUnobservedScoreTolerance = 1e-4;

// Whether rounding explains the difference.
bool IsRounding(const ScoreDifference& difference);

}  // namespace selfcal
