// Validation of a candidate: whether a calibration that the solver has found
// may become the active one (docs/operations.md, Validation). Pure functions.
//
// Each check passes, fails, or cannot be made. One that fails rejects the
// candidate, with a sentence that has the value, what it means and what to do;
// one that cannot be made is never treated as passed, and weakens the verdict.
// run_validation.cc gathers the evidence. Then Domain::FinishRun ends the run
// (server/domain/run_results.cc), in this order:
// - ABORTED if another version is active by now: it is validated again;
// - a device change among the segments is recorded (StoreSplit);
// - a candidate that passes is still rejected if, since the run was created,
//   the device has changed otherwise, or one of its segments became unusable
//   (RejectIfOutdated).
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/calibration/absent_effects.h"
#include "core/calibration/calibrate.h"
#include "core/model/rig.h"
#include "core/population/consistency.h"
#include "core/preflight/diagnose.h"
#include "server/pipeline/held_out.h"
#include "server/store/store.h"

namespace selfcal::server {

// Tolerances of the checks. Further constants: kOffSigmas and Biases
// (candidate_fit.cc), the latter with the findings that do not reject;
// kLeastDegrees and the level of LargestByChance (candidate_confirmation.cc);
// kHeldOut and kMaxNoiseOff (run_validation.cc); kMaxLinearisation
// (core/change/consistency.h); kReserve (server/domain/remembered.h).
struct CandidateLimits {
  // At least this share of the observations must have been used. Observations
  // are left out because they are outliers, near the border of the image, or of
  // landmarks without depth: a twentieth on the recordings of Tango, EuRoC and
  // an equidistant camera, a third if a quarter of the pixels are random. If
  // most are left out (99 % at a collapse) the result rests on what happened to
  // fit.
  double min_observations_used = 0.35;
  // The same for segments: if the majority contradicts the others, there is no
  // telling which of them are right.
  double min_segments_used = 0.5;
  // Residuals over those predicted by the noise that was used: 1 where the
  // model holds. Robust weights and the heavy tails of real trackers raise the
  // root mean square to as much as 2.
  double max_residual_ratio = 3;
  // A noise scale, as far as the residuals determine it, over the one that was
  // used. The estimator stops within 20 % of it, and a determined scale has a
  // standard deviation of 10 % at most; at 1.5 every sigma should be half as
  // large again.
  double max_noise_ratio = 1.5;
  // A noise scale above this is not noise: the residuals contain errors of the
  // model or of the data. Chosen, not measured.
  double max_pixel_noise = 10;
  double max_imu_noise = 20;
  // An effect that the rig does not estimate may shift a component by this many
  // sigmas of the candidate, and by so many without making it weak: chosen on
  // simulated devices, so that the shift and the noise together remain below
  // 4.5 sigmas (./test/evaluate --only trust), which is not reached for
  // accelerometers whose axes lie apart (docs/evaluation.md).
  double max_bias_sigmas = 2;
  double doubtful_bias_sigmas = 1;
  // A component may lie this many prior sigmas from the mean of the prior.
  // Chosen, not measured.
  double max_prior_sigmas = 10;
  // The sigma of a component that the active version observes may grow by at
  // most this factor. Chosen, not measured.
  double max_sigma_growth = 1.5;
  // A component is treated as observed if its sigma is below this part of the
  // prior's. Chosen, not measured.
  double observed_below = 0.5;
  // If a larger share of the segments that are remembered, kLeastToAgree or
  // more, contradicts the candidate, one of the two is wrong, or the device has
  // changed.
  double max_contradicting = 0.5;
  // For effects that the rig does not estimate, and for the agreement of the
  // halves, of held-out segments with the candidate, and of the data with the
  // prior. Chosen, not measured: each of the tests
  // rejects at most one sound candidate in 10,000, if the noise is as assumed.
  double min_probability = 1e-4;
  // Errors of the candidate over the stated ones, if the data contradicts the
  // prior, and that is as wrong in the directions that were held constant.
  // Chosen, not measured.
  double max_error_ratio = 1.1;
  // Largest variance between segments over that which noise explains; more if
  // few degrees of freedom are tested, so that chance alone exceeds it once in
  // a thousand times. Versions of 32 kinds of simulated devices have 0.96 in
  // the median, and active ones up to 1.36; a Tango has 0.78, EuRoC V1_01 with
  // unoptimised states at 1 keyframe a second 1.28 to 1.57
  // (./test/evaluate --only trust).
  double max_disagreement = 1.3;
  // If the readings of an IMU have more than this many times the noise that the
  // rig states, max_disagreement does not apply, and segments may disagree only
  // by what chance exceeds once in a hundred times. Chosen, not measured.
  double max_plain_imu_noise = 2;
};

struct CandidateEvidence {
  // True if the run started from the prior of the rig. After a device change it
  // starts from what is still known.
  bool has_factory_prior = true;
  // The active calibration, its covariance aged to now (CovarianceAt). If it
  // does not account for the last device change, its covariance is that of the
  // prior for the components that `changed` lists.
  StoredCalibration active;
  std::vector<int> changed;
  HeldOutSegments held_out;
  // Pre-flight of the segments that the result uses, at the calibration that
  // the run started from; nullopt if they could not be read.
  std::optional<Diagnosis> diagnosis;
  // Of these segments; nullopt likewise, or if the solver did not converge.
  std::optional<std::vector<AbsentEffect>> effects;
};

struct CandidateValidation {
  StoredValidation validation;
  // Why it must not become active: the sentences of the checks that failed.
  // Empty if it may.
  std::vector<std::string> reasons;
  // Why the active version must not be trusted either; empty: no reason.
  std::string of_active;
};

// The checks, in this order:
// - converged: the solver converged;
// - usable: the shape is that of the rig, every number is finite, every
//   variance at least 0, and theta obeys the rules for a calibration. Without a
//   proper shape, finite numbers and variances, no further check is made;
// - observations_used, segments_used: their shares;
// - pixel_residuals: their root mean square over the prediction of the noise
//   that was used; segment_residuals: the largest ratio of a segment, that of
//   its pixel residuals to the prediction of the noise, or that of its inertial
//   residuals to the median of all segments;
// - noise: no noise scale contradicts the one that was used, and none is beyond
//   what noise can be;
// - preflight: the segments show none of the common mistakes (core/preflight)
//   that bias a calibration;
// - effects: no effect that the rig does not estimate shifts a component by
//   much more than its uncertainty;
// - prior_sigmas: no free component is further from the mean of the prior than
//   the tolerances allow;
// - prior_agreement: the data does not contradict the prior, or determines
//   everything so well that this does not matter. Only of a candidate that
//   started from the prior of the rig;
// - rank: at least as many directions are estimated as by `active`, less the
//   components that have changed since;
// - sigma_growth: no component that `active` observes has become much less
//   certain, whatever its uncertainty, apart from what the probability of a
//   device change adds (RememberedUse::change_sigmas). Not tested if the
//   segments differ so that the device may have changed (RememberedUse::split):
//   then `active` is in doubt, and a larger sigma is consistent;
// - halves: calibrations on two halves of the segments agree;
// - disagreement: each segment agrees with all others as far as noise allows;
// - remembered: the segments without data do not contradict it by majority,
//   nor all together. Not made if there are too few near it;
// - held_out_probability: the information of held-out segments is not too
//   improbable under it (held_out.h), whichever one of them is left out;
// - confirmed: halves or held_out_probability was tested.
//
// If only `effects` fails, and the bias of that component is above
// doubtful_bias_sigmas in the sigmas of `active` too, this version must not be
// trusted either: it was computed on segments that hardly showed the effect.
CandidateValidation ValidateCandidate(const Rig& rig,
                                      const CalibrationResult& result,
                                      const CandidateEvidence& evidence,
                                      const CandidateLimits& limits = {});

// The errors of a candidate over the stated ones, as far as its prior is to
// blame: 1 unless the data contradicts the prior.
double ErrorRatio(const PriorAgreement& prior, const CandidateLimits& limits);

// True if the numbers can be used: shape, finite values, no negative variance.
bool HasUsableNumbers(const Rig& rig, const CalibrationResult& result);

// The noise scale of a kind that the calibration was weighted with.
double UsedNoise(const CalibrationResult& result, NoiseKind kind);

}  // namespace selfcal::server
