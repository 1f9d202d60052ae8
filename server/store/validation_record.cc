#include "server/store/validation_record.h"

#include "server/store/record_parts.h"
#include "server/store/records.h"

namespace selfcal::server {
namespace {

void PutHeldOut(const HeldOutTest& test, v1::Validation::HeldOut* message) {
  message->set_segments(test.segments);
  message->set_rescored(test.rescored);
  message->set_left_out(test.left_out);
  message->set_degrees(test.candidate.degrees);
  message->set_chi_square(test.candidate.statistic);
  message->set_probability(test.candidate.probability);
  message->set_active_chi_square(test.active.statistic);
  message->set_active_probability(test.active.probability);
}

HeldOutTest GetHeldOut(const v1::Validation::HeldOut& message) {
  HeldOutTest test;
  test.segments = message.segments();
  test.rescored = message.rescored();
  test.left_out = message.left_out();
  test.candidate = {
      message.chi_square(), message.degrees(), message.probability()};
  test.active = {message.active_chi_square(),
                 message.degrees(),
                 message.active_probability()};
  return test;
}

v1::Validation::Check::Outcome ToRecord(CheckOutcome outcome) {
  switch (outcome) {
    case CheckOutcome::kPassed:
      return v1::Validation::Check::PASSED;
    case CheckOutcome::kFailed:
      return v1::Validation::Check::FAILED;
    case CheckOutcome::kNotTested:
      return v1::Validation::Check::NOT_TESTED;
  }
  return v1::Validation::Check::OUTCOME_UNSPECIFIED;
}

CheckOutcome OutcomeOf(const v1::Validation::Check& check) {
  switch (check.outcome()) {
    case v1::Validation::Check::PASSED:
      return CheckOutcome::kPassed;
    case v1::Validation::Check::FAILED:
      return CheckOutcome::kFailed;
    case v1::Validation::Check::NOT_TESTED:
      return CheckOutcome::kNotTested;
    default:  // stored before there were outcomes
      return check.passed() ? CheckOutcome::kPassed : CheckOutcome::kFailed;
  }
}

v1::Verdict::Kind ToRecord(VerdictKind kind) {
  switch (kind) {
    case VerdictKind::kUnknown:
      return v1::Verdict::UNKNOWN;
    case VerdictKind::kGood:
      return v1::Verdict::GOOD;
    case VerdictKind::kWeak:
      return v1::Verdict::WEAK;
    case VerdictKind::kNotTrustworthy:
      return v1::Verdict::NOT_TRUSTWORTHY;
    case VerdictKind::kFactory:
      return v1::Verdict::FACTORY;
  }
  return v1::Verdict::UNKNOWN;
}

VerdictKind FromRecord(v1::Verdict::Kind kind) {
  switch (kind) {
    case v1::Verdict::GOOD:
      return VerdictKind::kGood;
    case v1::Verdict::WEAK:
      return VerdictKind::kWeak;
    case v1::Verdict::NOT_TRUSTWORTHY:
      return VerdictKind::kNotTrustworthy;
    case v1::Verdict::FACTORY:
      return VerdictKind::kFactory;
    default:
      return VerdictKind::kUnknown;
  }
}

void PutCheck(const ValidationCheck& check, v1::Validation::Check* message) {
  message->set_name(check.name);
  message->set_value(check.value);
  message->set_limit(check.limit);
  message->set_passed(check.outcome == CheckOutcome::kPassed);
  message->set_outcome(ToRecord(check.outcome));
  message->set_sentence(check.sentence);
}

}  // namespace

v1::Validation ValidationMessage(const StoredValidation& validation,
                                 bool accepted) {
  v1::Validation message;
  message.set_verdict(accepted ? v1::Validation::ACCEPTED
                               : v1::Validation::REJECTED);
  message.set_active_version(validation.active_version);
  for (const ValidationCheck& check : validation.checks) {
    PutCheck(check, message.add_checks());
  }
  PutHeldOut(validation.held_out, message.mutable_held_out());
  return message;
}

v1::Verdict VerdictMessage(const Verdict& verdict) {
  v1::Verdict message;
  message.set_kind(ToRecord(verdict.kind));
  message.mutable_sentences()->Assign(verdict.sentences.begin(),
                                      verdict.sentences.end());
  return message;
}

std::string SerializeValidation(const StoredCalibration& validated) {
  store::ValidationRecord record;
  record.set_rig(validated.rig);
  record.set_version(validated.version);
  record.mutable_reasons()->Assign(validated.reasons.begin(),
                                   validated.reasons.end());
  if (validated.validation) {
    *record.mutable_validation() = ValidationMessage(
        *validated.validation, validated.state != CalibrationState::kRejected);
  }
  *record.mutable_verdict() = VerdictMessage(validated.verdict);
  return record.SerializeAsString();
}

absl::Status ParseValidation(std::string_view bytes,
                             const std::string& what,
                             StoredCalibration* calibration) {
  store::ValidationRecord record;
  if (!ParseStored(bytes, &record) || record.rig() != calibration->rig ||
      record.version() != calibration->version) {
    return DamagedRecord("the validation of " + what);
  }
  calibration->reasons.assign(record.reasons().begin(), record.reasons().end());
  calibration->verdict = {FromRecord(record.verdict().kind()),
                          {record.verdict().sentences().begin(),
                           record.verdict().sentences().end()}};
  if (!record.has_validation()) {
    return absl::OkStatus();
  }
  const v1::Validation& message = record.validation();
  StoredValidation& validation = calibration->validation.emplace();
  validation.active_version = message.active_version();
  for (const v1::Validation::Check& check : message.checks()) {
    validation.checks.push_back({check.name(),
                                 check.value(),
                                 check.limit(),
                                 OutcomeOf(check),
                                 check.sentence()});
  }
  validation.held_out = GetHeldOut(message.held_out());
  return absl::OkStatus();
}

}  // namespace selfcal::server
