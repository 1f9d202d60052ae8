// The one verdict on a calibration version: good, weak, not trustworthy. Every
// interface shows this one and derives none of its own. Pure functions.
#pragma once

#include <string>

#include "core/calibration/calibrate.h"
#include "core/model/rig.h"
#include "server/pipeline/candidate_validation.h"
#include "server/store/store.h"

namespace selfcal::server {

// The verdict on a candidate that was validated.
// - Not trustworthy if a check failed; the sentences are those of the failed
//   checks.
// - Weak if directions were held constant, if the data determines a component
//   little better than the prior (its sigma is over half the prior's), if a
//   check could not be made, or if `effects` or `remembered` passed with a
//   sentence: an effect that the rig does not estimate shifts a component by
//   over its sigma, or the segments whose data is gone contradict it together.
//   Each has a sentence. Held-out segments may be missing if two halves agree.
// - Good otherwise; the notes of the checks are its sentences.
Verdict MakeVerdict(const Rig& rig,
                    const CalibrationResult& result,
                    const CandidateValidation& validated,
                    const CandidateLimits& limits = {});

// The verdict on a stored version: the one stored with it, except that the
// factory calibration is kFactory, a rejected version is not trustworthy for
// the reasons of its rejection, one on which the cores disagree in a
// verification is not trustworthy for that reason, nor is an active one of a
// device that has changed since, and one without a stored verdict is unknown.
Verdict VerdictOf(const StoredCalibration& calibration);

// "good", "weak", "not trustworthy", "factory", "unknown".
std::string VerdictText(VerdictKind kind);

}  // namespace selfcal::server
