// Whether a calibration that the solver has found may become the active one
// (method, section 6: a result is a candidate until it is validated).
// Pure functions.
#pragma once

#include <string>
#include <vector>

#include "core/calibration/calibrate.h"
#include "core/information/segment_information.h"
#include "core/model/rig.h"
#include "server/store/store.h"

namespace selfcal::server {

struct CandidateLimits {
  // A component may lie this many prior sigmas from the factory's value.
  double max_prior_sigmas = 10;
  // A component that both versions observe may lose at most this much.
  double max_sigma_growth = 1.5;
  // A component counts as observed where its sigma is below this part of the
  // prior's.
  double observed_below = 0.5;
  // What held-out segments show may be at least so probable under the
  // candidate.
  double min_held_out_probability = 1e-4;
};

struct Judgement {
  StoredValidation validation;
  // Why it must not become active, a sentence each; empty if it may.
  std::vector<std::string> reasons;
};

// Judges `result` against the active version, by
// - converged: the solver has;
// - usable: the shape is that of the rig, every number is finite, every
//   variance at least 0, and theta obeys the rules for a calibration;
// - prior_sigmas: no free component is further from the factory's value than
//   the tolerances allow;
// - sigma_growth: no component that both observe has become much less certain
//   than in `active`. The factory's version observes nothing: its sigmas are
//   the prior;
// - held_out_probability: what segments show that it was not calibrated on is
//   not too improbable under it (core/change), whichever of them is left out,
//   or it is more probable than under the active version. Segments that were
//   linearised far from the candidate cannot be tested, and are counted.
Judgement JudgeCandidate(const Rig& rig,
                         const StoredCalibration& active,
                         const CalibrationResult& result,
                         const std::vector<SegmentInformation>& held_out,
                         const CandidateLimits& limits = {});

}  // namespace selfcal::server
