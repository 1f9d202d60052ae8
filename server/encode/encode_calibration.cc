#include <algorithm>
#include <cmath>

#include "proto/convert.h"
#include "proto/resource_names.h"
#include "server/encode/encode.h"
#include "server/encode/encode_parts.h"
#include "server/pipeline/verdict.h"
#include "server/store/status_macros.h"

namespace selfcal::server {
namespace {

v1::Calibration::State EncodeState(CalibrationState state) {
  switch (state) {
    case CalibrationState::kActive:
      return v1::Calibration::ACTIVE;
    case CalibrationState::kSuperseded:
      return v1::Calibration::SUPERSEDED;
    case CalibrationState::kRejected:
      return v1::Calibration::REJECTED;
    case CalibrationState::kCandidate:
      return v1::Calibration::CANDIDATE;
    case CalibrationState::kRolledBack:
      return v1::Calibration::ROLLED_BACK;
  }
  return v1::Calibration::STATE_UNSPECIFIED;
}

std::string StatusName(CalibrateStatus status) {
  switch (status) {
    case CalibrateStatus::kConverged:
      return "converged";
    case CalibrateStatus::kNotConverged:
      return "not converged";
    case CalibrateStatus::kStalled:
      return "stalled";
    case CalibrateStatus::kCancelled:
      return "cancelled";
    case CalibrateStatus::kFailed:
      return "failed";
  }
  return "unknown";
}

void FillEstimates(const StoredCalibration& calibration,
                   const StoredRig& rig,
                   v1::Calibration* message) {
  const Calibration& factory = rig.rig.factory;
  const auto components = TangentComponents(calibration.theta);
  const Eigen::VectorXd values = ReadableValues(calibration.theta);
  const Eigen::MatrixXd& Sigma = calibration.covariance;
  const auto size = static_cast<Eigen::Index>(components.size());
  const bool has_covariance = Sigma.rows() == size && Sigma.cols() == size;
  const Eigen::VectorXd walk =
      WalkDensities(rig.rig, rig.policy.walk_densities);
  const bool has_factory = SameShape(calibration.theta, factory);
  const Eigen::VectorXd from_factory =
      has_factory ? BoxMinus(calibration.theta, factory) : Eigen::VectorXd();
  for (Eigen::Index i = 0; i < size; ++i) {
    v1::ComponentEstimate* estimate = message->add_estimates();
    estimate->set_component(components[i].name);
    estimate->set_unit(components[i].unit);
    estimate->set_value(values[i]);
    if (has_factory) estimate->set_from_factory(from_factory[i]);
    estimate->set_walk(walk[i]);
    if (!has_covariance) continue;
    estimate->set_sigma(std::sqrt(std::max(Sigma(i, i), 0.0)));
    for (Eigen::Index j = 0; j <= i; ++j) message->add_covariance(Sigma(i, j));
  }
}

void FillProvenance(const StoredCalibration& calibration,
                    v1::Calibration::Provenance* message) {
  message->set_recalibration(ChildName(
      calibration.rig, "recalibrations", std::to_string(*calibration.run)));
  message->set_base_version(calibration.base_version);
  for (const SegmentKey& key : calibration.segments) {
    message->add_segments(SegmentName(calibration.rig, key));
  }
  message->set_program_version(calibration.program_version);
  message->set_schema_version(calibration.schema_version);
  for (const auto& [name, value] : calibration.settings) {
    auto* setting = message->add_settings();
    setting->set_name(name);
    setting->set_value(value);
  }
  if (!calibration.temperatures) return;
  const SegmentTemperatures& temperatures = *calibration.temperatures;
  auto* temperature = message->mutable_temperature();
  temperature->set_segments(temperatures.segments);
  temperature->set_mean_c(temperatures.mean_c);
  temperature->set_min_c(temperatures.min_c);
  temperature->set_max_c(temperatures.max_c);
}

v1::Verdict::Kind EncodeKind(VerdictKind kind) {
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

void FillVerdict(const Verdict& verdict, v1::Verdict* message) {
  message->set_kind(EncodeKind(verdict.kind));
  message->set_text(VerdictText(verdict.kind));
  message->mutable_sentences()->Assign(verdict.sentences.begin(),
                                       verdict.sentences.end());
}

v1::Validation::Check::Outcome EncodeOutcome(CheckOutcome outcome) {
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

void FillAgreement(const AgreementTest& test, v1::AgreementTest* message) {
  message->set_chi_square(test.statistic);
  message->set_degrees(test.degrees);
  message->set_probability(test.probability);
}

void FillEvicted(const EvictedUse& use, v1::EvictedUse* message) {
  message->set_segments(use.segments);
  message->set_too_far(use.too_far);
  message->set_contradicting(use.contradicting);
  message->set_reach(use.reach);
  FillAgreement(use.agreement, message->mutable_agreement());
  message->set_unused(use.unused);
  message->set_change_probability(use.change_probability);
  message->mutable_change_sigmas()->Assign(use.change_sigmas.begin(),
                                           use.change_sigmas.end());
}

void FillNoiseFactor(const NoiseFactor& factor, v1::NoiseFactor* message) {
  message->set_kind(NoiseKindName(factor.kind));
  message->set_factor(factor.factor);
  message->set_log_sigma(factor.log_sigma);
  message->set_redundancy(factor.redundancy);
  message->set_determined(factor.determined());
  message->set_used(factor.used);
  message->set_converged(factor.converged);
}

void FillValidation(const StoredValidation& validation,
                    bool accepted,
                    v1::Validation* message) {
  message->set_verdict(accepted ? v1::Validation::ACCEPTED
                                : v1::Validation::REJECTED);
  message->set_active_version(validation.active_version);
  for (const ValidationCheck& check : validation.checks) {
    auto* added = message->add_checks();
    added->set_name(check.name);
    added->set_value(check.value);
    added->set_limit(check.limit);
    added->set_passed(check.outcome == CheckOutcome::kPassed);
    added->set_outcome(EncodeOutcome(check.outcome));
    added->set_sentence(check.sentence);
  }
  const HeldOutTest& test = validation.held_out;
  auto* held_out = message->mutable_held_out();
  held_out->set_segments(test.segments);
  held_out->set_left_out(test.left_out);
  held_out->set_rescored(test.rescored);
  held_out->set_degrees(test.candidate.degrees);
  held_out->set_chi_square(test.candidate.statistic);
  held_out->set_probability(test.candidate.probability);
  held_out->set_active_chi_square(test.active.statistic);
  held_out->set_active_probability(test.active.probability);
}

}  // namespace

void FillReport(const std::string& rig,
                const CalibrationResult& result,
                double seconds,
                v1::SolverReport* message) {
  message->set_status(StatusName(result.status));
  message->set_message(result.message);
  message->set_iterations(result.iterations);
  message->set_initial_cost(result.initial_cost);
  message->set_final_cost(result.final_cost);
  message->set_reprojection_rms_before_px(result.reprojection_rms_before_px);
  message->set_reprojection_rms_after_px(result.reprojection_rms_after_px);
  message->set_reprojection_median_before_px(
      result.reprojection_median_before_px);
  message->set_reprojection_median_after_px(
      result.reprojection_median_after_px);
  message->set_rank(result.rank);
  message->set_components(result.rank +
                          static_cast<int>(result.held_constant.size()));
  AddDirections(result.held_constant, message->mutable_held_constant());
  message->set_segments(result.segments);
  message->set_partitions(result.partitions);
  message->set_keyframes(result.keyframes);
  message->set_landmarks(result.landmarks);
  message->set_landmarks_dropped(result.landmarks_dropped);
  message->set_observations(result.observations);
  message->set_observations_dropped(result.observations_dropped);
  message->set_track_noise_factor(result.track_noise_factor);
  message->set_seconds(seconds);
  for (const NoiseFactor& factor : result.noise_factors) {
    FillNoiseFactor(factor, message->add_noise_factors());
  }
  for (const SegmentFit& fit : result.segment_fits) {
    v1::SegmentFit* added = message->add_segment_fits();
    added->set_segment(SegmentName(rig, fit.key));
    added->set_pixel_ratio(fit.pixel_ratio);
    added->set_inertial_ratio(fit.inertial_ratio);
    FillAgreement(fit.others, added->mutable_others());
    added->set_excluded(fit.excluded);
  }
  FillAgreement(result.halves, message->mutable_halves());
  FillEvicted(result.evicted, message->mutable_evicted());
}

v1::Calibration Encode(const StoredCalibration& calibration,
                       const StoredRig& rig) {
  v1::Calibration message;
  message.set_name(ChildName(
      calibration.rig, "calibrations", std::to_string(calibration.version)));
  message.set_version(calibration.version);
  message.set_state(EncodeState(calibration.state));
  SetTime(calibration.create_time_ns, message.mutable_create_time());
  *message.mutable_parameters() = ToProto(calibration.theta);
  FillEstimates(calibration, rig, &message);
  message.mutable_reasons()->Add(calibration.reasons.begin(),
                                 calibration.reasons.end());
  if (calibration.run) {
    FillProvenance(calibration, message.mutable_provenance());
  }
  if (calibration.report) {
    FillReport(calibration.rig,
               *calibration.report,
               calibration.seconds,
               message.mutable_solver());
  }
  if (calibration.validation) {
    FillValidation(*calibration.validation,
                   calibration.state != CalibrationState::kRejected,
                   message.mutable_validation());
  }
  FillVerdict(VerdictOf(calibration), message.mutable_verdict());
  return message;
}

absl::StatusOr<v1::Calibration> Encode(Store* store,
                                       const StoredCalibration& calibration) {
  SELFCAL_ASSIGN_OR_RETURN(const StoredRig rig, store->GetRig(calibration.rig));
  return Encode(calibration, rig);
}

}  // namespace selfcal::server
