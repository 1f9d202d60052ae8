// Record of a calibration.
#include <google/protobuf/io/coded_stream.h>
#include <google/protobuf/wire_format_lite.h>

#include <cstdint>
#include <set>

#include "proto/convert.h"
#include "server/convert/convert.h"
#include "server/status/status_macros.h"
#include "server/store/earlier_report.h"
#include "server/store/record_parts.h"
#include "server/store/records.h"

namespace selfcal::server {

std::string SerializeCalibration(const StoredCalibration& calibration) {
  store::CalibrationRecord record;
  record.set_rig(calibration.rig);
  record.set_version(calibration.version);
  *record.mutable_theta() = ToProto(calibration.theta);
  PutMatrix(calibration.covariance, record.mutable_covariance());
  PutComponents(calibration.theta,
                calibration.covariance.rows(),
                record.mutable_components());
  record.set_base_version(calibration.base_version);
  record.set_program_version(calibration.program_version);
  if (calibration.report) {
    *record.mutable_report() =
        ToProto(*calibration.report, calibration.rig, calibration.seconds);
    if (calibration.report->covariance_of_data.size() > 0) {
      PutMatrix(calibration.report->covariance_of_data,
                record.mutable_covariance_of_data());
    }
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

namespace {

using VersionRecord = store::CalibrationRecord;

// The bytes of a message without some of its fields, which are then not parsed.
// Bytes that are no message remain as they are: the parser refuses them.
std::string WithoutFields(const std::set<int>& fields, std::string_view bytes) {
  using google::protobuf::internal::WireFormatLite;
  const int size = static_cast<int>(bytes.size());
  google::protobuf::io::CodedInputStream in(
      reinterpret_cast<const std::uint8_t*>(bytes.data()), size);
  std::string kept;
  for (int begin = 0; begin < size; begin = in.CurrentPosition()) {
    const std::uint32_t tag = in.ReadTag();
    if (tag == 0 || !WireFormatLite::SkipField(&in, tag)) {
      return std::string(bytes);
    }
    if (fields.contains(WireFormatLite::GetTagFieldNumber(tag))) continue;
    kept.append(bytes.substr(begin, in.CurrentPosition() - begin));
  }
  return kept;
}

// Fields of the record that only some readers need; most of its bytes.
const std::set<int>& StepFields() {
  static const std::set<int>& fields =
      *new std::set<int>{VersionRecord::kStepsFieldNumber};
  return fields;
}
const std::set<int>& DetailFields() {
  static const std::set<int>& fields =
      *new std::set<int>{VersionRecord::kStepsFieldNumber,
                         VersionRecord::kCovarianceFieldNumber,
                         VersionRecord::kCovarianceOfDataFieldNumber,
                         VersionRecord::kSettingsFieldNumber};
  return fields;
}

bool ParseBytes(std::string_view bytes, VersionRecord* record) {
  if (!ParseStored(bytes, record)) {
    return false;
  }
  if (record->has_earlier_report()) {
    *record->mutable_report() =
        Upgrade(record->earlier_report(), record->rig());
  }
  return true;
}

// Without the steps.
absl::StatusOr<StoredCalibration> FromRecord(const VersionRecord& record,
                                             const std::string& what) {
  StoredCalibration calibration;
  if (!FromProto(record.theta(), "", &calibration.theta).empty() ||
      !GetMatrix(record.covariance(), &calibration.covariance) ||
      !ToTangent(
          calibration.theta, record.components(), &calibration.covariance)) {
    return DamagedRecord(what);
  }
  calibration.rig = record.rig();
  calibration.version = record.version();
  calibration.reasons.assign(record.reasons().begin(), record.reasons().end());
  calibration.base_version = record.base_version();
  calibration.program_version = record.program_version();
  if (record.has_report()) {
    calibration.report = FromProto(record.report());
    calibration.report->theta = calibration.theta;
    calibration.report->covariance = calibration.covariance;
    if (!ToTangent(calibration.theta,
                   record.components(),
                   &calibration.report->remembered.change_sigmas) ||
        !GetMatrix(record.covariance_of_data(),
                   &calibration.report->covariance_of_data) ||
        !ToTangent(calibration.theta,
                   record.components(),
                   &calibration.report->covariance_of_data)) {
      return DamagedRecord(what);
    }
  }
  calibration.seconds = record.seconds();
  calibration.schema_version = record.schema_version();
  for (const auto& setting : record.settings()) {
    calibration.settings.emplace_back(setting.name(), setting.value());
  }
  return calibration;
}

}  // namespace

absl::StatusOr<StoredCalibration> ParseCalibration(std::string_view bytes,
                                                   const std::string& what) {
  VersionRecord record;
  if (!ParseBytes(bytes, &record)) return DamagedRecord(what);
  SELFCAL_ASSIGN_OR_RETURN(StoredCalibration calibration,
                           FromRecord(record, what));
  for (const store::StepRecord& step : record.steps()) {
    if (!GetStep(
            step, record.components(), &calibration.steps.emplace_back())) {
      return DamagedRecord(what);
    }
  }
  return calibration;
}

absl::StatusOr<StoredCalibration> ParseWithoutSteps(std::string_view bytes,
                                                    const std::string& what) {
  VersionRecord record;
  if (!ParseBytes(WithoutFields(StepFields(), bytes), &record))
    return DamagedRecord(what);
  return FromRecord(record, what);
}

absl::StatusOr<StoredCalibration> ParseSummary(std::string_view bytes,
                                               const std::string& what) {
  VersionRecord record;
  if (!ParseBytes(WithoutFields(DetailFields(), bytes), &record)) {
    return DamagedRecord(what);
  }
  if (record.has_report()) record.mutable_report()->clear_segment_fits();
  return FromRecord(record, what);
}

absl::StatusOr<StoredCalibration> ParseReport(std::string_view bytes,
                                              const std::string& what) {
  VersionRecord record;
  if (!ParseBytes(WithoutFields(DetailFields(), bytes), &record)) {
    return DamagedRecord(what);
  }
  StoredCalibration calibration;
  calibration.rig = record.rig();
  calibration.version = record.version();
  if (record.has_report()) calibration.report = FromProto(record.report());
  calibration.seconds = record.seconds();
  return calibration;
}

}  // namespace selfcal::server
