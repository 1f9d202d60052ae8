#include "server/store/records.h"

#include "proto/convert.h"
#include "server/store/record_parts.h"
#include "server/store/rig_policy.h"
#include "server/store/status_macros.h"

namespace selfcal::server {
namespace {

template <typename Message>
absl::Status ParseMessage(std::string_view bytes,
                          const std::string& what,
                          Message* message) {
  return message->ParseFromArray(bytes.data(), static_cast<int>(bytes.size()))
             ? absl::OkStatus()
             : DamagedRecord(what);
}

void PutResiduals(const ResidualStatistics& residuals,
                  v1::ResidualStatistics* message) {
  message->set_observations(residuals.observations);
  message->set_inliers(residuals.inliers);
  message->set_not_projectable(residuals.not_projectable);
  message->set_outliers(residuals.outliers);
  message->set_landmarks(residuals.landmarks);
  message->set_landmarks_used(residuals.landmarks_used);
  message->set_reprojection_rms_px(residuals.reprojection_rms_px);
  message->set_reprojection_median_px(residuals.reprojection_median_px);
  for (const double rms : residuals.inertial_rms) {
    message->add_inertial_rms(rms);
  }
  message->set_many_outliers(residuals.many_outliers);
  message->set_fit(residuals.fit);
  message->set_imu_gaps(residuals.imu_gaps);
  message->set_longest_imu_gap_s(residuals.longest_imu_gap_s);
}

ResidualStatistics GetResiduals(const v1::ResidualStatistics& message) {
  ResidualStatistics residuals;
  residuals.observations = message.observations();
  residuals.inliers = message.inliers();
  residuals.not_projectable = message.not_projectable();
  residuals.outliers = message.outliers();
  residuals.landmarks = message.landmarks();
  residuals.landmarks_used = message.landmarks_used();
  residuals.reprojection_rms_px = message.reprojection_rms_px();
  residuals.reprojection_median_px = message.reprojection_median_px();
  residuals.inertial_rms.assign(message.inertial_rms().begin(),
                                message.inertial_rms().end());
  residuals.many_outliers = message.many_outliers();
  residuals.fit = message.fit();
  residuals.imu_gaps = message.imu_gaps();
  residuals.longest_imu_gap_s = message.longest_imu_gap_s();
  return residuals;
}

void PutGroup(const GroupScore& score, v1::GroupScore* message) {
  message->set_group(score.group);
  message->set_size(score.size);
  message->set_entropy_nats(score.entropy);
  message->set_gain_nats(score.gain);
  message->set_rank(score.rank);
  PutDirections(score.unobserved, message->mutable_unobserved());
}

GroupScore GetGroup(const v1::GroupScore& message) {
  GroupScore score;
  score.group = message.group();
  score.size = message.size();
  score.entropy = message.entropy_nats();
  score.gain = message.gain_nats();
  score.rank = message.rank();
  score.unobserved = GetDirections(message.unobserved());
  return score;
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
  store::SegmentInformationRecord record;
  *record.mutable_theta0() = ToProto(information.theta0);
  PutMatrix(information.Lambda, record.mutable_lambda());
  PutVector(information.eta, record.mutable_eta());
  record.set_rank(information.rank);
  PutDirections(information.unobserved, record.mutable_unobserved());
  for (const GroupScore& score : information.groups) {
    PutGroup(score, record.add_groups());
  }
  PutResiduals(information.residuals, record.mutable_residuals());
  PutLandmarks(information.landmarks, record.mutable_landmarks());
  return record.SerializeAsString();
}

absl::StatusOr<SegmentInformation> ParseInformation(std::string_view bytes,
                                                    const std::string& what) {
  store::SegmentInformationRecord record;
  SELFCAL_RETURN_IF_ERROR(ParseMessage(bytes, what, &record));
  SegmentInformation information;
  if (!FromProto(record.theta0(), "", &information.theta0).empty() ||
      !GetMatrix(record.lambda(), &information.Lambda) ||
      !GetLandmarks(record.landmarks(), &information.landmarks)) {
    return DamagedRecord(what);
  }
  information.eta = GetVector(record.eta());
  AddTimeOffsets(information.theta0, &information.Lambda);
  AddTimeOffsets(information.theta0, &information.eta);
  information.rank = record.rank();
  information.unobserved = GetDirections(record.unobserved());
  for (const v1::GroupScore& group : record.groups()) {
    information.groups.push_back(GetGroup(group));
  }
  information.residuals = GetResiduals(record.residuals());
  return information;
}

}  // namespace selfcal::server
