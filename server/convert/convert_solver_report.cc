#include <optional>

#include "proto/resource_names.h"
#include "server/convert/convert.h"

namespace selfcal::server {
namespace {

v1::SolverReport::Outcome OutcomeOf(CalibrateStatus status) {
  switch (status) {
    case CalibrateStatus::kConverged:
      return v1::SolverReport::CONVERGED;
    case CalibrateStatus::kNotConverged:
      return v1::SolverReport::NOT_CONVERGED;
    case CalibrateStatus::kStalled:
      return v1::SolverReport::STALLED;
    case CalibrateStatus::kCancelled:
      return v1::SolverReport::CANCELLED;
    case CalibrateStatus::kFailed:
      return v1::SolverReport::FAILED;
  }
  return v1::SolverReport::OUTCOME_UNSPECIFIED;
}

CalibrateStatus StatusOf(v1::SolverReport::Outcome outcome) {
  switch (outcome) {
    case v1::SolverReport::CONVERGED:
      return CalibrateStatus::kConverged;
    case v1::SolverReport::NOT_CONVERGED:
      return CalibrateStatus::kNotConverged;
    case v1::SolverReport::STALLED:
      return CalibrateStatus::kStalled;
    case v1::SolverReport::CANCELLED:
      return CalibrateStatus::kCancelled;
    default:
      return CalibrateStatus::kFailed;
  }
}

std::string StatusText(CalibrateStatus status) {
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

void Put(const AgreementTest& test, v1::AgreementTest* message) {
  message->set_chi_square(test.statistic);
  message->set_degrees(test.degrees);
  message->set_probability(test.probability);
}

AgreementTest Get(const v1::AgreementTest& message) {
  // No test was made: the probability is 1 by default, not the 0 of an absent
  // message.
  if (message.degrees() == 0) return {};
  return {message.chi_square(), message.degrees(), message.probability()};
}

void Put(const NoiseScale& scale, v1::NoiseFactor* message) {
  message->set_kind(NoiseKindName(scale.kind));
  message->set_factor(scale.factor);
  message->set_log_sigma(scale.log_sigma);
  message->set_redundancy(scale.redundancy);
  message->set_determined(scale.determined());
  message->set_used(scale.used);
  message->set_converged(scale.converged);
}

// `used` is 0 in messages from before the noise could be reweighted, or before
// that was stored. Nothing for a kind that is unknown.
std::optional<NoiseScale> Get(const v1::NoiseFactor& message) {
  const auto kind = FindNoiseKind(message.kind());
  if (!kind) return std::nullopt;
  NoiseScale scale;
  scale.kind = *kind;
  scale.factor = message.factor();
  scale.log_sigma = message.log_sigma();
  scale.redundancy = message.redundancy();
  if (message.used() > 0) {
    scale.used = message.used();
    scale.converged = message.converged();
  }
  return scale;
}

void Put(const std::string& rig,
         const SegmentFit& fit,
         v1::SegmentFit* message) {
  message->set_segment(SegmentName(rig, fit.key));
  message->set_pixel_ratio(fit.pixel_ratio);
  message->set_inertial_ratio(fit.inertial_ratio);
  Put(fit.others, message->mutable_others());
  message->set_excluded(fit.excluded);
}

SegmentKey KeyOf(const std::string& segment) {
  const auto parts = ParseSegmentName(segment);
  return parts ? parts->key : SegmentKey();
}

SegmentFit Get(const v1::SegmentFit& message) {
  return {KeyOf(message.segment()),
          message.pixel_ratio(),
          message.inertial_ratio(),
          Get(message.others()),
          message.excluded()};
}

void Put(const std::string& rig,
         const DeviceSplit& split,
         v1::DeviceSplit* message) {
  message->set_probability(split.probability);
  message->set_probability_without_one(split.without_one);
  message->set_drift(split.kind == ChangeKind::kDrift);
  message->set_newer(split.newer);
  message->set_first(SegmentName(rig, split.first));
  message->set_block(split.block);
  message->mutable_groups()->Assign(split.concerned.begin(),
                                    split.concerned.end());
}

DeviceSplit Get(const v1::DeviceSplit& message) {
  return {message.probability(),
          message.probability_without_one(),
          message.drift() ? ChangeKind::kDrift : ChangeKind::kSudden,
          message.newer(),
          KeyOf(message.first()),
          message.block(),
          {message.groups().begin(), message.groups().end()}};
}

void Put(const std::string& rig,
         const RememberedUse& use,
         v1::EvictedUse* message) {
  message->set_segments(use.segments);
  if (use.segments > 0) message->set_newest(SegmentName(rig, use.newest));
  message->set_too_far(use.too_far);
  message->set_contradicting(use.contradicting);
  message->set_compared(use.compared);
  message->set_reach(use.reach);
  Put(use.agreement, message->mutable_agreement());
  message->set_unused(use.unused);
  message->set_change_probability(use.change_probability);
  ToProto(use.change_sigmas, message->mutable_change_sigmas());
  if (use.split) Put(rig, *use.split, message->mutable_split());
}

RememberedUse Get(const v1::EvictedUse& message) {
  RememberedUse use;
  use.segments = message.segments();
  use.newest = KeyOf(message.newest());
  use.too_far = message.too_far();
  use.contradicting = message.contradicting();
  use.compared = message.compared();
  use.reach = message.reach();
  use.agreement = Get(message.agreement());
  use.unused = message.unused();
  use.change_probability = message.change_probability();
  use.change_sigmas = FromProto(message.change_sigmas());
  if (message.has_split()) use.split = Get(message.split());
  return use;
}

}  // namespace

v1::SolverReport ToProto(const CalibrationResult& result,
                         const std::string& rig,
                         double seconds) {
  v1::SolverReport message;
  message.set_outcome(OutcomeOf(result.status));
  message.set_status(StatusText(result.status));
  message.set_message(result.message);
  message.set_iterations(result.iterations);
  message.set_initial_cost(result.initial_cost);
  message.set_final_cost(result.final_cost);
  message.set_reprojection_rms_before_px(result.reprojection_rms_before_px);
  message.set_reprojection_rms_after_px(result.reprojection_rms_after_px);
  message.set_reprojection_median_before_px(
      result.reprojection_median_before_px);
  message.set_reprojection_median_after_px(result.reprojection_median_after_px);
  message.set_rank(result.rank);
  message.set_components(result.rank +
                         static_cast<int>(result.held_constant.size()));
  ToProto(result.held_constant, message.mutable_held_constant());
  message.set_segments(result.segments);
  message.set_partitions(result.partitions);
  message.set_keyframes(result.keyframes);
  message.set_landmarks(result.landmarks);
  message.set_landmarks_dropped(result.landmarks_dropped);
  message.set_observations(result.observations);
  message.set_observations_dropped(result.observations_dropped);
  message.set_seconds(seconds);
  message.set_track_noise_factor(result.track_noise_factor);
  for (const NoiseScale& scale : result.noise_scales) {
    Put(scale, message.add_noise_factors());
  }
  for (const SegmentFit& fit : result.segment_fits) {
    Put(rig, fit, message.add_segment_fits());
  }
  Put(result.halves, message.mutable_halves());
  Put(rig, result.remembered, message.mutable_evicted());
  return message;
}

CalibrationResult FromProto(const v1::SolverReport& message) {
  CalibrationResult result;
  result.status = StatusOf(message.outcome());
  result.message = message.message();
  result.iterations = message.iterations();
  result.initial_cost = message.initial_cost();
  result.final_cost = message.final_cost();
  result.reprojection_rms_before_px = message.reprojection_rms_before_px();
  result.reprojection_rms_after_px = message.reprojection_rms_after_px();
  result.reprojection_median_before_px =
      message.reprojection_median_before_px();
  result.reprojection_median_after_px = message.reprojection_median_after_px();
  result.rank = message.rank();
  result.held_constant = FromProto(message.held_constant());
  result.segments = message.segments();
  result.partitions = message.partitions();
  result.keyframes = message.keyframes();
  result.landmarks = message.landmarks();
  result.landmarks_dropped = message.landmarks_dropped();
  result.observations = message.observations();
  result.observations_dropped = message.observations_dropped();
  result.track_noise_factor = message.track_noise_factor();
  for (const v1::NoiseFactor& factor : message.noise_factors()) {
    if (const auto known = Get(factor)) result.noise_scales.push_back(*known);
  }
  for (const v1::SegmentFit& fit : message.segment_fits()) {
    result.segment_fits.push_back(Get(fit));
  }
  result.halves = Get(message.halves());
  result.remembered = Get(message.evicted());
  return result;
}

}  // namespace selfcal::server
