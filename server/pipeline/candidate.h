// Whether a calibration that the solver has found may become the active one
// (method, section 6: a result is a candidate until it is validated).
// Pure functions.
//
// Each check passes, fails, or could not be made. One that fails rejects the
// candidate, with a sentence that has the value, what it means and what to do;
// one that could not be made never counts as passed, and weakens the verdict.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/calibration/calibrate.h"
#include "core/model/rig.h"
#include "core/preflight/diagnose.h"
#include "server/pipeline/held_out.h"
#include "server/store/store.h"

namespace selfcal::server {

struct CandidateLimits {
  // At least this share of the observations must have been used. What is left
  // out is outlying, near the border of the image, or of landmarks without
  // depth: a twentieth on the recordings of Tango, EuRoC and an equidistant
  // camera, a third with a quarter of the pixels at random. Where most is left
  // out (99 % at a collapse) the result rests on what happened to fit.
  double min_observations_used = 0.35;
  // The same for segments: where the majority contradicts the others, none of
  // them can be told to be right.
  double min_segments_used = 0.5;
  // Residuals over those that the noise which was used predicts: 1 where the
  // model holds. Robust weights and heavy tails of real trackers make the
  // root mean square up to 2.
  double max_residual_ratio = 3;
  // A noise factor over the one that was used, where the residuals tell. The
  // estimator stops within 20 % of it, and a determined factor has a standard
  // deviation of 10 % at most; by 1.5 every sigma is too small by half.
  double max_noise_ratio = 1.5;
  // Noise of more than so many times what the rig states is no noise: the
  // residuals hold errors of the model or of the data.
  double max_pixel_noise = 10;
  double max_imu_noise = 20;
  // A component may lie this many prior sigmas from the factory's value.
  double max_prior_sigmas = 10;
  // A component that the active version observes may lose at most this much.
  double max_sigma_growth = 1.5;
  // A component counts as observed where its sigma is below this part of the
  // prior's.
  double observed_below = 0.5;
  // Of the agreement of halves, and of what held-out segments show under the
  // candidate.
  double min_probability = 1e-4;
  // Largest variance by which segments differ, over that which noise explains;
  // more where few degrees are tested and chance alone exceeds it once in a
  // thousand times. Simulated devices of ten kinds have 0.76 to 1.21, a Tango
  // 0.9 to 1.1, EuRoC V1_01 with unoptimised states at 1 keyframe a second 1.4
  // to 1.8.
  double max_disagreement = 1.3;
};

struct CandidateEvidence {
  // What is active. After a change of the device that it does not know of, its
  // covariance is the prior for the components that `changed` lists.
  StoredCalibration active;
  std::vector<int> changed;
  HeldOutSegments held_out;
  // Of the segments that the result uses, at the calibration that the run
  // started from; nothing where they could not be read.
  std::optional<Diagnosis> diagnosis;
};

struct CandidateValidation {
  StoredValidation validation;
  // Why it must not become active, the sentences of the checks that failed;
  // empty if it may.
  std::vector<std::string> reasons;
};

// In this order:
// - converged: the solver has;
// - usable: the shape is that of the rig, every number is finite, every
//   variance at least 0, and theta obeys the rules for a calibration. If the
//   numbers are not, nothing else is checked;
// - observations_used, segments_used: their shares;
// - pixel_residuals: their root mean square over what the noise that was used
//   predicts; segment_residuals: the largest such ratio of a segment, of pixels
//   or of inertial residuals;
// - noise: no factor contradicts the noise that was used, and none is beyond
//   what noise can be;
// - preflight: the segments show none of the usual mistakes (core/preflight)
//   that bias a calibration;
// - prior_sigmas: no free component is further from the factory's value than
//   the tolerances allow;
// - rank: at least as many directions are estimated as by `active`, less the
//   components that have changed since;
// - sigma_growth: no component that `active` observes has become much less
//   certain, however uncertain it is now, but for what the chance of a change
//   of the device adds (EvictedUse::change_sigmas); not tested where the
//   segments differ so that the device may have changed (EvictedUse::split):
//   then `active` is in doubt, and to be less certain is honest;
// - halves: calibrations on two halves of the segments agree;
// - disagreement: each segment agrees with all others as far as noise allows;
// - held_out_probability: what segments show that it was not calibrated on is
//   not too improbable under it (held_out.h), whichever of them is left out;
// - confirmed: at least one of the two tests before was made.
CandidateValidation ValidateCandidate(const Rig& rig,
                                      const CalibrationResult& result,
                                      const CandidateEvidence& evidence,
                                      const CandidateLimits& limits = {});

// Whether the numbers are there at all: shape, finite, no negative variance.
bool HasUsableNumbers(const Rig& rig, const CalibrationResult& result);

// The noise of a kind that the calibration was weighted with, as a factor of
// what the rig states.
double UsedNoise(const CalibrationResult& result, NoiseKind kind);

}  // namespace selfcal::server
