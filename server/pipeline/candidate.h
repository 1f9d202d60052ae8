// Whether a calibration that the solver has found may become the active one
// (method, section 6: a result is a candidate until it is validated).
// Pure functions.
#pragma once

#include <string>
#include <vector>

#include "core/calibration/calibrate.h"
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
};

// Why `result` must not become active, a sentence each; empty if it may:
// - the solver has converged;
// - every number is finite, every variance at least 0;
// - theta obeys the rules for a calibration, and no free component is further
//   from the factory's value than the tolerances allow;
// - no component that both observe has become much less certain than in
//   `active`. The factory's version observes nothing: its sigmas are the prior.
std::vector<std::string> CandidateProblems(const Rig& rig,
                                           const StoredCalibration& active,
                                           const CalibrationResult& result,
                                           const CandidateLimits& limits = {});

}  // namespace selfcal::server
