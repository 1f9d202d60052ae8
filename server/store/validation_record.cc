// The record of what a candidate was judged by.
#include "server/store/record_parts.h"
#include "server/store/records.h"

namespace selfcal::server {
namespace {

void PutHeldOut(const HeldOutTest& test, v1::Validation::HeldOut* message) {
  message->set_segments(test.segments);
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
  test.left_out = message.left_out();
  test.candidate = {
      message.chi_square(), message.degrees(), message.probability()};
  test.active = {message.active_chi_square(),
                 message.degrees(),
                 message.active_probability()};
  return test;
}

}  // namespace

std::string SerializeValidation(const StoredCalibration& judged) {
  store::ValidationRecord record;
  record.set_rig(judged.rig);
  record.set_version(judged.version);
  record.mutable_reasons()->Assign(judged.reasons.begin(),
                                   judged.reasons.end());
  if (judged.validation) {
    v1::Validation* message = record.mutable_validation();
    message->set_verdict(judged.state == CalibrationState::kRejected
                             ? v1::Validation::REJECTED
                             : v1::Validation::ACCEPTED);
    message->set_active_version(judged.validation->active_version);
    for (const ValidationCheck& check : judged.validation->checks) {
      v1::Validation::Check* added = message->add_checks();
      added->set_name(check.name);
      added->set_value(check.value);
      added->set_limit(check.limit);
      added->set_passed(check.passed);
    }
    PutHeldOut(judged.validation->held_out, message->mutable_held_out());
  }
  return record.SerializeAsString();
}

absl::Status ParseValidation(std::string_view bytes,
                             const std::string& what,
                             StoredCalibration* calibration) {
  store::ValidationRecord record;
  if (!record.ParseFromArray(bytes.data(), static_cast<int>(bytes.size())) ||
      record.rig() != calibration->rig ||
      record.version() != calibration->version) {
    return DamagedRecord("the validation of " + what);
  }
  calibration->reasons.assign(record.reasons().begin(), record.reasons().end());
  if (!record.has_validation()) {
    return absl::OkStatus();
  }
  const v1::Validation& message = record.validation();
  StoredValidation& validation = calibration->validation.emplace();
  validation.active_version = message.active_version();
  for (const v1::Validation::Check& check : message.checks()) {
    validation.checks.push_back(
        {check.name(), check.value(), check.limit(), check.passed()});
  }
  validation.held_out = GetHeldOut(message.held_out());
  return absl::OkStatus();
}

}  // namespace selfcal::server
