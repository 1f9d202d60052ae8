// Record of a calibration, with the solver's report.
#include "proto/convert.h"
#include "server/store/record_parts.h"
#include "server/store/records.h"
#include "server/store/status_macros.h"

namespace selfcal::server {
namespace {

using store::SolverRecord;

SolverRecord::Status ToRecord(CalibrateStatus status) {
  switch (status) {
    case CalibrateStatus::kConverged:
      return SolverRecord::CONVERGED;
    case CalibrateStatus::kNotConverged:
      return SolverRecord::NOT_CONVERGED;
    case CalibrateStatus::kStalled:
      return SolverRecord::STALLED;
    case CalibrateStatus::kCancelled:
      return SolverRecord::CANCELLED;
    case CalibrateStatus::kFailed:
      return SolverRecord::FAILED;
  }
  return SolverRecord::STATUS_UNSPECIFIED;
}

CalibrateStatus FromRecord(SolverRecord::Status status) {
  switch (status) {
    case SolverRecord::CONVERGED:
      return CalibrateStatus::kConverged;
    case SolverRecord::NOT_CONVERGED:
      return CalibrateStatus::kNotConverged;
    case SolverRecord::STALLED:
      return CalibrateStatus::kStalled;
    case SolverRecord::CANCELLED:
      return CalibrateStatus::kCancelled;
    default:
      return CalibrateStatus::kFailed;
  }
}

void PutAgreement(const AgreementTest& test, v1::AgreementTest* message) {
  message->set_chi_square(test.statistic);
  message->set_degrees(test.degrees);
  message->set_probability(test.probability);
}

AgreementTest GetAgreement(const v1::AgreementTest& message) {
  // No test was made: the probability is 1 by default, not the 0 of an absent
  // message.
  if (message.degrees() == 0) return {};
  return {message.chi_square(), message.degrees(), message.probability()};
}

void PutNoiseFactor(const NoiseFactor& factor, v1::NoiseFactor* message) {
  message->set_kind(NoiseKindName(factor.kind));
  message->set_factor(factor.factor);
  message->set_log_sigma(factor.log_sigma);
  message->set_redundancy(factor.redundancy);
  message->set_determined(factor.determined());
  message->set_used(factor.used);
  message->set_converged(factor.converged);
}

// `used` is 0 in records from before the noise could be reweighted, or before
// that was stored.
void GetNoiseFactor(const v1::NoiseFactor& message,
                    std::vector<NoiseFactor>* factors) {
  const auto kind = FindNoiseKind(message.kind());
  if (!kind) return;
  NoiseFactor factor;
  factor.kind = *kind;
  factor.factor = message.factor();
  factor.log_sigma = message.log_sigma();
  factor.redundancy = message.redundancy();
  if (message.used() > 0) {
    factor.used = message.used();
    factor.converged = message.converged();
  }
  factors->push_back(factor);
}

void PutFit(const SegmentFit& fit, store::SegmentFitRecord* record) {
  record->set_session(fit.key.session);
  record->set_index(fit.key.index);
  record->set_pixel_ratio(fit.pixel_ratio);
  record->set_inertial_ratio(fit.inertial_ratio);
  PutAgreement(fit.others, record->mutable_others());
  record->set_excluded(fit.excluded);
}

SegmentFit GetFit(const store::SegmentFitRecord& record) {
  return {{record.session(), record.index()},
          record.pixel_ratio(),
          record.inertial_ratio(),
          GetAgreement(record.others()),
          record.excluded()};
}

void PutEvicted(const EvictedUse& use, v1::EvictedUse* message) {
  message->set_segments(use.segments);
  message->set_too_far(use.too_far);
  message->set_contradicting(use.contradicting);
  message->set_reach(use.reach);
  PutAgreement(use.agreement, message->mutable_agreement());
  message->set_unused(use.unused);
  message->set_change_probability(use.change_probability);
  PutVector(use.change_sigmas, message->mutable_change_sigmas());
}

EvictedUse GetEvicted(const v1::EvictedUse& message) {
  EvictedUse use;
  use.segments = message.segments();
  use.too_far = message.too_far();
  use.contradicting = message.contradicting();
  use.reach = message.reach();
  use.agreement = GetAgreement(message.agreement());
  use.unused = message.unused();
  use.change_probability = message.change_probability();
  use.change_sigmas = GetVector(message.change_sigmas());
  return use;
}

void PutSplit(const DeviceSplit& split, store::DeviceSplitRecord* record) {
  record->set_probability(split.probability);
  record->set_without_one(split.without_one);
  record->set_drift(split.kind == ChangeKind::kDrift);
  record->set_newer(split.newer);
  record->set_session(split.first.session);
  record->set_index(split.first.index);
  record->set_block(split.block);
  record->mutable_concerned()->Assign(split.concerned.begin(),
                                      split.concerned.end());
}

DeviceSplit GetSplit(const store::DeviceSplitRecord& record) {
  return {record.probability(),
          record.without_one(),
          record.drift() ? ChangeKind::kDrift : ChangeKind::kSudden,
          record.newer(),
          {record.session(), record.index()},
          record.block(),
          {record.concerned().begin(), record.concerned().end()}};
}

// Leaves out theta and covariance, which are stored with the calibration.
void PutSolver(const CalibrationResult& result, SolverRecord* record) {
  record->set_status(ToRecord(result.status));
  record->set_message(result.message);
  record->set_rank(result.rank);
  PutDirections(result.held_constant, record->mutable_held_constant());
  record->set_iterations(result.iterations);
  record->set_initial_cost(result.initial_cost);
  record->set_final_cost(result.final_cost);
  record->set_reprojection_rms_before_px(result.reprojection_rms_before_px);
  record->set_reprojection_rms_after_px(result.reprojection_rms_after_px);
  record->set_reprojection_median_before_px(
      result.reprojection_median_before_px);
  record->set_reprojection_median_after_px(result.reprojection_median_after_px);
  record->set_segments(result.segments);
  record->set_partitions(result.partitions);
  record->set_keyframes(result.keyframes);
  record->set_landmarks(result.landmarks);
  record->set_landmarks_dropped(result.landmarks_dropped);
  record->set_observations(result.observations);
  record->set_observations_dropped(result.observations_dropped);
  record->set_track_noise_factor(result.track_noise_factor);
  for (const NoiseFactor& factor : result.noise_factors) {
    PutNoiseFactor(factor, record->add_noise_factors());
  }
  for (const SegmentFit& fit : result.segment_fits) {
    PutFit(fit, record->add_segment_fits());
  }
  PutAgreement(result.halves, record->mutable_halves());
  PutEvicted(result.evicted, record->mutable_evicted());
  if (result.evicted.split) {
    PutSplit(*result.evicted.split, record->mutable_split());
  }
}

CalibrationResult GetSolver(const SolverRecord& record) {
  CalibrationResult result;
  result.status = FromRecord(record.status());
  result.message = record.message();
  result.rank = record.rank();
  result.held_constant = GetDirections(record.held_constant());
  result.iterations = record.iterations();
  result.initial_cost = record.initial_cost();
  result.final_cost = record.final_cost();
  result.reprojection_rms_before_px = record.reprojection_rms_before_px();
  result.reprojection_rms_after_px = record.reprojection_rms_after_px();
  result.reprojection_median_before_px = record.reprojection_median_before_px();
  result.reprojection_median_after_px = record.reprojection_median_after_px();
  result.segments = record.segments();
  result.partitions = record.partitions();
  result.keyframes = record.keyframes();
  result.landmarks = record.landmarks();
  result.landmarks_dropped = record.landmarks_dropped();
  result.observations = record.observations();
  result.observations_dropped = record.observations_dropped();
  result.track_noise_factor = record.track_noise_factor();
  for (const v1::NoiseFactor& message : record.noise_factors()) {
    GetNoiseFactor(message, &result.noise_factors);
  }
  for (const store::SegmentFitRecord& fit : record.segment_fits()) {
    result.segment_fits.push_back(GetFit(fit));
  }
  result.halves = GetAgreement(record.halves());
  result.evicted = GetEvicted(record.evicted());
  if (record.has_split()) result.evicted.split = GetSplit(record.split());
  return result;
}

void PutStep(const CalibrateProgress& step, store::StepRecord* record) {
  record->set_iteration(step.iteration);
  record->set_max_iterations(step.max_iterations);
  record->set_cost(step.cost);
  record->set_step_sigmas(step.step_sigmas);
  if (step.sigmas.size() == 0) return;
  *record->mutable_theta() = ToProto(step.theta);
  record->mutable_moved()->Add(step.moved.begin(), step.moved.end());
  record->mutable_sigmas()->Add(step.sigmas.begin(), step.sigmas.end());
}

bool GetStep(const store::StepRecord& record, CalibrateProgress* step) {
  step->iteration = record.iteration();
  step->max_iterations = record.max_iterations();
  step->cost = record.cost();
  step->step_sigmas = record.step_sigmas();
  if (record.sigmas().empty()) return true;
  if (!FromProto(record.theta(), "", &step->theta).empty()) return false;
  const int size = TangentSize(step->theta);
  if (record.moved_size() != size || record.sigmas_size() != size) return false;
  step->moved = Eigen::Map<const Eigen::VectorXd>(record.moved().data(), size);
  step->sigmas =
      Eigen::Map<const Eigen::VectorXd>(record.sigmas().data(), size);
  return true;
}

}  // namespace

std::string SerializeCalibration(const StoredCalibration& calibration) {
  store::CalibrationRecord record;
  record.set_rig(calibration.rig);
  record.set_version(calibration.version);
  *record.mutable_theta() = ToProto(calibration.theta);
  PutMatrix(calibration.covariance, record.mutable_covariance());
  record.set_base_version(calibration.base_version);
  record.set_program_version(calibration.program_version);
  if (calibration.report) {
    PutSolver(*calibration.report, record.mutable_solver());
  }
  record.set_seconds(calibration.seconds);
  record.set_schema_version(calibration.schema_version);
  for (const auto& [name, value] : calibration.settings) {
    auto* setting = record.add_settings();
    setting->set_name(name);
    setting->set_value(value);
  }
  for (const CalibrateProgress& step : calibration.steps) {
    PutStep(step, record.add_steps());
  }
  return record.SerializeAsString();
}

absl::StatusOr<StoredCalibration> ParseCalibration(std::string_view bytes,
                                                   const std::string& what) {
  store::CalibrationRecord record;
  StoredCalibration calibration;
  if (!record.ParseFromArray(bytes.data(), static_cast<int>(bytes.size())) ||
      !FromProto(record.theta(), "", &calibration.theta).empty() ||
      !GetMatrix(record.covariance(), &calibration.covariance)) {
    return DamagedRecord(what);
  }
  AddTimeOffsets(calibration.theta, &calibration.covariance);
  calibration.rig = record.rig();
  calibration.version = record.version();
  calibration.reasons.assign(record.reasons().begin(), record.reasons().end());
  calibration.base_version = record.base_version();
  calibration.program_version = record.program_version();
  if (record.has_solver()) {
    calibration.report = GetSolver(record.solver());
    calibration.report->theta = calibration.theta;
    calibration.report->covariance = calibration.covariance;
  }
  calibration.seconds = record.seconds();
  calibration.schema_version = record.schema_version();
  for (const auto& setting : record.settings()) {
    calibration.settings.emplace_back(setting.name(), setting.value());
  }
  for (const store::StepRecord& step : record.steps()) {
    if (!GetStep(step, &calibration.steps.emplace_back())) {
      return DamagedRecord(what);
    }
  }
  return calibration;
}

}  // namespace selfcal::server
