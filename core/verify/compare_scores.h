// Compares two scores of one segment, in dimensionless figures. Pure, callable
// from any thread.
#pragma once

#include "core/information/segment_information.h"
#include "core/model/rig.h"

namespace selfcal {

struct ScoreDifference {
  // Largest difference of the groups' entropies [nat].
  double entropy_nats = 0;
  // Relative difference of the information of theta, prior included, in the
  // direction that differs most, which is also that of its variance. The
  // entropy of a group of k components cannot differ by more than k / 2 times
  // this.
  double information = 0;
  // Difference of the resulting estimates, in their standard deviations, in the
  // direction that differs most.
  double estimate_sigmas = 0;
  // Limit of each that rounding explains.
  double tolerance = 0;
};

// Infinite if shapes differ, or a number is not finite.
ScoreDifference CompareScores(const Rig& rig,
                              const SegmentInformation& a,
                              const SegmentInformation& b);

// Two computations of one score in double precision differ by rounding: by eps
// = 2.2e-16 times the amplification by elimination, the ratio of the
// information of a factor about a variable to what remains of it. A landmark
// keeps along its ray 1e-10 of its information across it (its prior of 1 km),
// which explains 1e-6.
inline constexpr double kScoreTolerance = 1e-6;
// If a segment does not observe all of theta, a direction depends on what the
// weak priors leave of the inertial factors: at rest an accelerometer's scale
// looks like its bias, about which the prior (100 m/s^2) has 1e-12 of the
// information of the factors.
inline constexpr double kUnobservedScoreTolerance = 1e-4;

// Returns true if rounding explains the difference.
bool IsRounding(const ScoreDifference& difference);

}  // namespace selfcal
