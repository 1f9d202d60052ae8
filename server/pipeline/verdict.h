// The one verdict on a version of a calibration: good, weak, not trustworthy.
// Every interface shows this one and makes up none of its own. Pure functions.
#pragma once

#include <string>

#include "core/calibration/calibrate.h"
#include "core/model/rig.h"
#include "server/pipeline/candidate.h"
#include "server/store/store.h"

namespace selfcal::server {

// Of a candidate that was validated.
// - Not trustworthy if a check failed: the sentences of those.
// - Weak if directions were held, if the data says less about a component than
//   what was known before (its sigma is over half the prior's), or if a check
//   could not be made, each with a sentence; but held-out segments need not be
//   there where two halves agree.
// - Good otherwise; what the checks noted are its sentences.
Verdict MakeVerdict(const Rig& rig,
                    const CalibrationResult& result,
                    const CandidateValidation& validated,
                    const CandidateLimits& limits = {});

// Of a version as it is stored: that which was stored with it. The factory's is
// kFactory, a rejected one not trustworthy for the reasons that it was rejected
// for, one on which a verification found the cores to disagree not trustworthy
// for that, one from before there were verdicts unknown.
Verdict VerdictOf(const StoredCalibration& calibration);

// "good", "weak", "not trustworthy", "factory", "unknown".
std::string VerdictText(VerdictKind kind);

}  // namespace selfcal::server
