#include "server/worker/job.h"

#include <utility>

#include "proto/convert.h"
#include "selfcal/worker/job.pb.h"
#include "server/convert/convert.h"
#include "server/store/record_parts.h"
#include "server/store/records.h"
#include "server/store/segment_ends.h"

namespace selfcal::server {
namespace {

template <typename Message>
bool Parse(std::string_view bytes, Message* message) {
  return message->ParseFromArray(bytes.data(), static_cast<int>(bytes.size()));
}

void PutRemembered(const CalibrateOptions& options, worker::Options* message) {
  for (const RememberedSegment& one : options.remembered) {
    worker::Remembered* added = message->add_remembered();
    added->set_session(one.key.session);
    added->set_index(one.key.index);
    if (one.ends) added->set_ends(SerializeEnds(*one.ends));
    added->set_fit(one.fit);
    added->set_time_ns(one.time_ns);
  }
  ToProto(options.walk, message->mutable_walk());
  message->mutable_changing()->Assign(options.changing.begin(),
                                      options.changing.end());
}

void PutOptions(const CalibrateOptions& options, worker::Options* message) {
  message->set_loss(static_cast<int>(options.loss));
  message->set_loss_scale(options.loss_scale);
  if (options.prior) {
    *message->mutable_prior()->mutable_centre() =
        ToProto(options.prior->centre);
    PutMatrix(options.prior->information,
              message->mutable_prior()->mutable_information());
  }
  message->set_max_iterations(options.max_iterations);
  message->set_correlated_tracks(options.correlated_tracks);
  message->set_noise_factors(options.noise_scales);
  message->set_reweight_noise(options.reweight_noise);
  message->set_merge_landmarks(options.merge_landmarks);
  message->set_solver(static_cast<int>(options.solver));
  message->set_threads(options.threads);
  message->set_exclude_contradictions(options.exclude_contradictions);
  PutRemembered(options, message);
}

void PutLimits(const WorkerLimits& limits, worker::Limits* message) {
  message->set_idle(limits.idle);
  message->set_max_memory_bytes(limits.max_memory_bytes);
}

bool GetRemembered(const worker::Options& message, CalibrateOptions* options) {
  for (const worker::Remembered& one : message.remembered()) {
    RememberedSegment& added = options->remembered.emplace_back();
    added.key = {one.session(), one.index()};
    added.fit = one.fit();
    added.time_ns = one.time_ns();
    if (one.ends().empty()) continue;
    auto ends = ParseEnds(one.ends());
    if (!ends.ok()) return false;
    added.ends = *std::move(ends);
  }
  options->walk = FromProto(message.walk());
  options->changing.assign(message.changing().begin(),
                           message.changing().end());
  return true;
}

bool GetOptions(const worker::Options& message, CalibrateOptions* options) {
  options->loss = static_cast<LossKind>(message.loss());
  options->loss_scale = message.loss_scale();
  if (message.has_prior()) {
    ThetaPrior& prior = options->prior.emplace();
    if (!FromProto(message.prior().centre(), "", &prior.centre).empty() ||
        !GetMatrix(message.prior().information(), &prior.information)) {
      return false;
    }
  }
  options->max_iterations = message.max_iterations();
  options->correlated_tracks = message.correlated_tracks();
  options->noise_scales = message.noise_factors();
  options->reweight_noise = message.reweight_noise();
  options->merge_landmarks = message.merge_landmarks();
  options->solver = static_cast<SolverKind>(message.solver());
  options->threads = message.threads();
  options->exclude_contradictions = message.exclude_contradictions();
  return GetRemembered(message, options);
}

}  // namespace

std::string EncodeJob(const Job& job) {
  worker::Job message;
  *message.mutable_rig() = ToProto(job.rig);
  *message.mutable_theta_start() = ToProto(job.theta_start);
  if (job.scorer) {
    message.mutable_score()->set_scorer(static_cast<int>(*job.scorer));
  } else {
    PutOptions(job.options, message.mutable_options());
  }
  PutLimits(job.limits, message.mutable_limits());
  return message.SerializeAsString();
}

std::string EncodeSegment(const MotionSegment& segment) {
  return ToProto(segment).SerializeAsString();
}

std::string EncodeProgress(const CalibrateProgress& progress) {
  store::StepRecord record;
  PutStep(progress, &record);
  return record.SerializeAsString();
}

std::string EncodeResult(const CalibrationResult& result) {
  worker::Result message;
  if (result.status == CalibrateStatus::kFailed) {
    message.set_failure(result.message);
    return message.SerializeAsString();
  }
  StoredCalibration calibration;
  calibration.rig = "-";  // any: a worker does not know its name
  calibration.theta = result.theta;
  calibration.covariance = result.covariance;
  calibration.report = result;
  message.mutable_calibration()->set_record(SerializeCalibration(calibration));
  PutMatrix(result.Lambda, message.mutable_calibration()->mutable_lambda());
  return message.SerializeAsString();
}

std::string EncodeScore(const SegmentInformation& information) {
  worker::Result message;
  message.set_score(SerializeInformation(information));
  return message.SerializeAsString();
}

std::optional<Job> DecodeJob(std::string_view bytes) {
  worker::Job message;
  Job job;
  if (!Parse(bytes, &message) ||
      !FromProto(message.rig(), "", &job.rig).empty() ||
      !FromProto(message.theta_start(), "", &job.theta_start).empty()) {
    return std::nullopt;
  }
  if (message.has_score()) {
    job.scorer = static_cast<ScorerKind>(message.score().scorer());
  } else if (!GetOptions(message.options(), &job.options)) {
    return std::nullopt;
  }
  job.limits.idle = message.limits().idle();
  job.limits.max_memory_bytes = message.limits().max_memory_bytes();
  return job;
}

std::optional<MotionSegment> DecodeSegment(std::string_view bytes) {
  v1::MotionSegment message;
  MotionSegment segment;
  if (!Parse(bytes, &message) || !FromProto(message, "", &segment).empty()) {
    return std::nullopt;
  }
  return segment;
}

std::optional<CalibrateProgress> DecodeProgress(std::string_view bytes) {
  store::StepRecord record;
  CalibrateProgress progress;
  if (!Parse(bytes, &record) || record.sigmas().empty() ||
      !GetStep(record, {}, &progress)) {
    return std::nullopt;
  }
  return progress;
}

std::optional<CalibrationResult> DecodeResult(std::string_view bytes) {
  worker::Result message;
  if (!Parse(bytes, &message)) {
    return std::nullopt;
  }
  if (message.has_failure()) {
    CalibrationResult failed;
    failed.message = message.failure();
    return failed;
  }
  auto calibration =
      ParseCalibration(message.calibration().record(), "the worker's result");
  if (!calibration.ok() || !calibration->report) {
    return std::nullopt;
  }
  CalibrationResult result = *std::move(calibration->report);
  if (!GetMatrix(message.calibration().lambda(), &result.Lambda)) {
    return std::nullopt;
  }
  return result;
}

absl::StatusOr<SegmentInformation> DecodeScore(std::string_view bytes) {
  worker::Result message;
  if (!Parse(bytes, &message)) {
    return absl::InternalError("its process ended without a result");
  }
  if (message.has_failure()) return absl::InternalError(message.failure());
  return ParseInformation(message.score(), "the worker's result");
}

}  // namespace selfcal::server
