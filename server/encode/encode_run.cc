#include "proto/resource_names.h"
#include "server/convert/convert.h"
#include "server/encode/encode.h"
#include "server/encode/set_time.h"
#include "server/status/status_macros.h"

namespace selfcal::server {
namespace {

v1::Recalibration::State EncodeRunState(RunState state) {
  switch (state) {
    case RunState::kPending:
      return v1::Recalibration::PENDING;
    case RunState::kRunning:
      return v1::Recalibration::RUNNING;
    case RunState::kSucceeded:
      return v1::Recalibration::SUCCEEDED;
    case RunState::kFailed:
      return v1::Recalibration::FAILED;
    case RunState::kCancelled:
      return v1::Recalibration::CANCELLED;
  }
  return v1::Recalibration::STATE_UNSPECIFIED;
}

// Components that the rig holds fixed have no sigma and are skipped. The
// message is a Recalibration or a ConvergenceStep.
template <typename Message>
void FillProgress(const CalibrateProgress& progress, Message* message) {
  message->set_iteration(progress.iteration);
  message->set_cost(progress.cost);
  message->set_step_sigmas(progress.step_sigmas);
  if (progress.sigmas.size() == 0) return;
  const auto components = TangentComponents(progress.theta);
  const Eigen::VectorXd values = ReadableValues(progress.theta);
  for (Eigen::Index i = 0; i < progress.sigmas.size(); ++i) {
    if (progress.sigmas[i] == 0) continue;
    v1::ComponentProgress* parameter = message->add_parameters();
    parameter->set_component(components[i].name);
    parameter->set_unit(components[i].unit);
    parameter->set_value(values[i]);
    parameter->set_moved(progress.moved[i]);
    parameter->set_sigma(progress.sigmas[i]);
  }
}

}  // namespace

v1::Recalibration Encode(const StoredRun& run,
                         const CalibrateProgress& progress,
                         const StoredCalibration* calibration) {
  v1::Recalibration message;
  message.set_name(
      ChildName(run.rig, "recalibrations", std::to_string(run.run)));
  message.set_state(EncodeRunState(run.state));
  message.set_trigger(static_cast<v1::Recalibration::Trigger>(run.trigger));
  SetTime(run.create_time_ns, message.mutable_create_time());
  if (run.end_time_ns != 0) {
    SetTime(run.end_time_ns, message.mutable_end_time());
  }
  for (const SegmentKey& key : run.segments) {
    message.add_segments(SegmentName(run.rig, key));
  }
  FillProgress(progress, &message);
  message.set_max_iterations(progress.max_iterations);
  message.set_message(run.message);
  message.set_attempts(run.attempts);
  if (run.calibration_version != 0) {
    message.set_calibration(ChildName(
        run.rig, "calibrations", std::to_string(run.calibration_version)));
  }
  if (calibration != nullptr && calibration->report) {
    *message.mutable_solver() =
        ToProto(*calibration->report, run.rig, calibration->seconds);
  }
  return message;
}

absl::StatusOr<v1::Recalibration> EncodeWithReport(
    Store* store, const StoredRun& run, const CalibrateProgress& progress) {
  if (run.calibration_version == 0) return Encode(run, progress, nullptr);
  SELFCAL_ASSIGN_OR_RETURN(
      const StoredCalibration calibration,
      store->GetCalibration(run.rig, run.calibration_version));
  return Encode(run, progress, &calibration);
}

absl::StatusOr<v1::Recalibration> EncodeWithConvergence(Store* store,
                                                        const StoredRun& run) {
  if (run.calibration_version == 0) return Encode(run, {}, nullptr);
  SELFCAL_ASSIGN_OR_RETURN(
      const StoredCalibration calibration,
      store->GetCalibration(run.rig, run.calibration_version));
  v1::Recalibration message = Encode(run, {}, &calibration);
  for (const CalibrateProgress& step : calibration.steps) {
    FillProgress(step, message.add_convergence());
  }
  return message;
}

}  // namespace selfcal::server
