// The checks of a candidate, by subject. Each function adds one or more of them
// to the list. Internal to the validation (candidate_validation.h).
#pragma once

#include <string>
#include <vector>

#include "server/pipeline/candidate_validation.h"

namespace selfcal::server {

struct CheckContext {
  const Rig& rig;
  const CalibrationResult& result;
  const CandidateEvidence& evidence;
  const CandidateLimits& limits;
};

// Adds a check that passed, or, if `failure` is not empty, failed.
void AddResult(std::string name,
               double value,
               double limit,
               std::string failure,
               std::vector<ValidationCheck>* checks);

void AddNotTested(std::string name,
                  double limit,
                  std::string sentence,
                  std::vector<ValidationCheck>* checks);

// candidate_fit.cc: how well the data fits the result. observations_used,
// segments_used, pixel_residuals, segment_residuals, noise, preflight, effects.
void CheckFit(const CheckContext& context,
              std::vector<ValidationCheck>* checks);
// CandidateValidation::of_active, if `effects` fails.
std::string EffectOnActive(const CheckContext& context);

// candidate_estimate.cc: the estimate compared with the prior and the
// active one. prior_sigmas, prior_agreement, rank, sigma_growth.
void CheckEstimate(const CheckContext& context,
                   std::vector<ValidationCheck>* checks);

// candidate_confirmation.cc: independent data. halves, disagreement,
// remembered, held_out_probability, confirmed.
void CheckConfirmation(const CheckContext& context,
                       StoredValidation* validation);

}  // namespace selfcal::server
