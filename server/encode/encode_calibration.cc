#include <algorithm>
#include <cmath>
#include <utility>

#include "core/model/temperature.h"
#include "proto/convert.h"
#include "proto/resource_names.h"
#include "server/convert/convert.h"
#include "server/encode/encode.h"
#include "server/encode/set_time.h"
#include "server/pipeline/verdict.h"
#include "server/status/status_macros.h"
#include "server/store/validation_record.h"

namespace selfcal::server {
v1::Calibration::State EncodeCalibrationState(CalibrationState state) {
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

namespace {

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

}  // namespace

v1::Calibration EncodeSummary(const StoredCalibration& calibration) {
  v1::Calibration message;
  message.set_name(ChildName(
      calibration.rig, "calibrations", std::to_string(calibration.version)));
  message.set_version(calibration.version);
  message.set_state(EncodeCalibrationState(calibration.state));
  SetTime(calibration.create_time_ns, message.mutable_create_time());
  *message.mutable_parameters() = ToProto(calibration.theta);
  if (HasSlopes(calibration.theta)) {
    message.set_temperature_c(calibration.theta.reference_temperature_c);
  }
  message.mutable_reasons()->Add(calibration.reasons.begin(),
                                 calibration.reasons.end());
  if (calibration.run) {
    FillProvenance(calibration, message.mutable_provenance());
  }
  if (calibration.report) {
    *message.mutable_solver() =
        ToProto(*calibration.report, calibration.rig, calibration.seconds);
  }
  if (calibration.validation) {
    *message.mutable_validation() =
        ValidationMessage(*calibration.validation,
                          calibration.state != CalibrationState::kRejected);
  }
  const Verdict verdict = VerdictOf(calibration);
  *message.mutable_verdict() = VerdictMessage(verdict);
  message.mutable_verdict()->set_text(VerdictText(verdict.kind));
  return message;
}

v1::Calibration Encode(const StoredCalibration& calibration,
                       const StoredRig& rig) {
  v1::Calibration message = EncodeSummary(calibration);
  FillEstimates(calibration, rig, &message);
  return message;
}

CalibrationAtTemperature AtTemperature(StoredCalibration calibration,
                                       StoredRig rig,
                                       double temperature_c) {
  Eigen::MatrixXd& Sigma = calibration.covariance;
  if (Sigma.rows() == TangentSize(calibration.theta)) {
    Sigma = CovarianceAtTemperature(calibration.theta, Sigma, temperature_c);
  }
  calibration.theta = AtTemperature(calibration.theta, temperature_c);
  rig.rig.factory = AtTemperature(rig.rig.factory, temperature_c);
  rig.rig.prior_mean.reset();  // it has slopes
  return {std::move(calibration), std::move(rig)};
}

absl::StatusOr<v1::Calibration> Encode(Store* store,
                                       const StoredCalibration& calibration) {
  SELFCAL_ASSIGN_OR_RETURN(const StoredRig rig, store->GetRig(calibration.rig));
  return Encode(calibration, rig);
}

}  // namespace selfcal::server
