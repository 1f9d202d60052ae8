#include "server/store/records.h"

#include "proto/convert.h"
#include "server/convert/convert.h"
#include "server/status/status_macros.h"
#include "server/store/record_parts.h"
#include "server/store/rig_policy.h"
#include "server/store/segment_rows.h"

namespace selfcal::server {
namespace {

absl::Status ParseMessage(std::string_view bytes,
                          const std::string& what,
                          google::protobuf::Message* message) {
  return ParseStored(bytes, message) ? absl::OkStatus() : DamagedRecord(what);
}

void PutLandmarks(const LandmarkSketch& landmarks,
                  store::LandmarkSketchRecord* record) {
  for (const LandmarkSketch::Entry& entry : landmarks.entries) {
    record->add_ids(entry.id);
    record->add_observations(entry.observations);
  }
}

bool GetLandmarks(const store::LandmarkSketchRecord& record,
                  LandmarkSketch* landmarks) {
  if (record.ids_size() != record.observations_size()) return false;
  for (int k = 0; k < record.ids_size(); ++k) {
    landmarks->entries.push_back({record.ids(k), record.observations(k)});
  }
  return true;
}

store::SegmentInformationRecord ToRecord(
    const SegmentInformation& information) {
  store::SegmentInformationRecord record;
  *record.mutable_theta0() = ToProto(information.theta0);
  PutMatrix(information.Lambda, record.mutable_lambda());
  ToProto(information.eta, record.mutable_eta());
  PutComponents(
      information.theta0, information.eta.size(), record.mutable_components());
  record.set_rank(information.rank);
  ToProto(information.unobserved, record.mutable_unobserved());
  for (const GroupScore& score : information.groups) {
    *record.add_groups() = ToProto(score);
  }
  *record.mutable_residuals() = ToProto(information.residuals);
  PutLandmarks(information.landmarks, record.mutable_landmarks());
  return record;
}

absl::StatusOr<SegmentInformation> FromRecord(
    const store::SegmentInformationRecord& record, const std::string& what) {
  SegmentInformation information;
  information.eta = FromProto(record.eta());
  const ComponentNames& names = record.components();
  if (!FromProto(record.theta0(), "", &information.theta0).empty() ||
      !GetMatrix(record.lambda(), &information.Lambda) ||
      !ToTangent(information.theta0, names, &information.Lambda) ||
      !ToTangent(information.theta0, names, &information.eta) ||
      !GetLandmarks(record.landmarks(), &information.landmarks)) {
    return DamagedRecord(what);
  }
  information.rank = record.rank();
  information.unobserved = FromProto(record.unobserved());
  for (const v1::GroupScore& group : record.groups()) {
    information.groups.push_back(FromProto(group));
  }
  information.residuals = FromProto(record.residuals());
  return information;
}

}  // namespace

std::string SerializeRig(const StoredRig& rig) {
  store::RigRecord record;
  *record.mutable_rig() = ToProto(rig.rig);
  PutPolicy(rig.policy, record.mutable_rig());
  record.mutable_rig()->mutable_labels()->insert(rig.labels.begin(),
                                                 rig.labels.end());
  return record.SerializeAsString();
}

absl::StatusOr<StoredRig> ParseRig(std::string_view bytes,
                                   const std::string& what) {
  store::RigRecord record;
  SELFCAL_RETURN_IF_ERROR(ParseMessage(bytes, what, &record));
  StoredRig rig;
  // Stored before the selection could be chosen.
  if (record.rig().selection() == v1::Rig::SELECTION_UNSPECIFIED) {
    record.mutable_rig()->set_selection(v1::Rig::TABLES);
  }
  if (!FromProto(record.rig(), "", &rig.rig).empty() ||
      !GetPolicy(record.rig(), &rig.policy).empty()) {
    return DamagedRecord(what);
  }
  rig.labels.insert(record.rig().labels().begin(), record.rig().labels().end());
  return rig;
}

std::string SerializeInformation(const SegmentInformation& information) {
  return ToRecord(information).SerializeAsString();
}

std::string SerializeInformationOf(const std::string& rig,
                                   const SegmentKey& key,
                                   const SegmentInformation& information) {
  store::SegmentInformationRecord record = ToRecord(information);
  record.set_rig(rig);
  record.set_session(key.session);
  record.set_index(key.index);
  return record.SerializeAsString();
}

absl::StatusOr<SegmentInformation> ParseInformation(std::string_view bytes,
                                                    const std::string& what) {
  store::SegmentInformationRecord record;
  SELFCAL_RETURN_IF_ERROR(ParseMessage(bytes, what, &record));
  return FromRecord(record, what);
}

absl::StatusOr<SegmentInformation> ParseInformationOf(const std::string& rig,
                                                      const SegmentKey& key,
                                                      std::string_view bytes) {
  const std::string what = "the information of " + SegmentText(rig, key);
  store::SegmentInformationRecord record;
  SELFCAL_RETURN_IF_ERROR(ParseMessage(bytes, what, &record));
  if (!record.rig().empty()) {
    const SegmentKey named = {record.session(), record.index()};
    if (record.rig() != rig || named != key) {
      return OfAnotherSegment(what, record.rig(), named);
    }
  }
  return FromRecord(record, what);
}

}  // namespace selfcal::server
