#include "server/encode/encode_verification.h"

#include <algorithm>

#include "proto/resource_names.h"

namespace selfcal::server {
namespace {

using Response = v1::VerifyRigResponse;

Response::Outcome EncodeOutcome(VerificationOutcome outcome) {
  switch (outcome) {
    case VerificationOutcome::kAgrees:
      return Response::AGREES;
    case VerificationOutcome::kDiffers:
      return Response::DIFFERS;
    case VerificationOutcome::kNotCompared:
      return Response::NOT_COMPARED;
  }
  return Response::OUTCOME_UNSPECIFIED;
}

void Put(const std::string& rig,
         const ScoreCheck& check,
         Response::ScoreCheck* message) {
  message->set_segment(SegmentName(rig, check.segment));
  message->set_outcome(EncodeOutcome(check.outcome));
  message->set_entropy_difference_nats(check.difference.entropy_nats);
  message->set_information_difference(check.difference.information);
  message->set_estimate_difference_sigmas(check.difference.estimate_sigmas);
  message->set_message(check.message);
}

void Put(const CalibrationCheck& check, Response::CalibrationCheck* message) {
  message->set_version(check.version);
  message->set_outcome(EncodeOutcome(check.outcome));
  message->set_theta_difference_sigmas(check.difference.theta_sigmas);
  message->set_theta_component(check.difference.theta_component);
  message->set_sigma_difference(check.difference.sigma);
  message->set_sigma_component(check.difference.sigma_component);
  message->set_covariance_difference(check.difference.covariance);
  message->set_segments(check.segments);
  message->set_segments_gone(check.segments_gone);
  message->set_message(check.message);
}

}  // namespace

v1::VerifyRigResponse Encode(const std::string& rig,
                             const VerificationStep& step) {
  Response response;
  if (step.score != nullptr) {
    Put(rig, *step.score, response.mutable_score());
  } else if (step.calibration != nullptr) {
    Put(*step.calibration, response.mutable_calibration());
  } else {
    response.mutable_progress()->set_done(step.done);
    response.mutable_progress()->set_total(step.total);
    response.mutable_progress()->set_subject(step.subject);
  }
  return response;
}

v1::VerifyRigResponse Encode(const Verification& verification) {
  Response response;
  Response::Summary& summary = *response.mutable_summary();
  summary.set_scores(static_cast<int>(verification.scores.size()));
  int differing = 0;
  int not_compared = 0;
  ScoreDifference largest;
  for (const ScoreCheck& check : verification.scores) {
    differing += check.outcome == VerificationOutcome::kDiffers ? 1 : 0;
    not_compared += check.outcome == VerificationOutcome::kNotCompared ? 1 : 0;
    const ScoreDifference& by = check.difference;
    largest.entropy_nats = std::max(largest.entropy_nats, by.entropy_nats);
    largest.information = std::max(largest.information, by.information);
    largest.estimate_sigmas =
        std::max(largest.estimate_sigmas, by.estimate_sigmas);
  }
  summary.set_scores_differing(differing);
  summary.set_scores_not_compared(not_compared);
  summary.set_entropy_difference_nats(largest.entropy_nats);
  summary.set_information_difference(largest.information);
  summary.set_estimate_difference_sigmas(largest.estimate_sigmas);
  if (verification.calibration) {
    Put(*verification.calibration, summary.mutable_calibration());
  }
  summary.set_version(verification.version);
  summary.set_finding(DisagreementText(verification));
  return response;
}

}  // namespace selfcal::server
