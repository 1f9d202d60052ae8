#include <fmt/format.h>

#include <algorithm>

#include "proto/convert.h"
#include "proto/resource_names.h"
#include "server/encode/encode.h"
#include "server/encode/encode_parts.h"
#include "server/store/rig_policy.h"

namespace selfcal::server {
namespace {

v1::Segment::State EncodeState(SegmentState state) {
  switch (state) {
    case SegmentState::kStored:
      return v1::Segment::STORED;
    case SegmentState::kScored:
      return v1::Segment::SCORED;
    case SegmentState::kUnusable:
      return v1::Segment::UNUSABLE;
  }
  return v1::Segment::STATE_UNSPECIFIED;
}

void FillScore(const GroupScore& score,
               const std::vector<std::string>& tables,
               v1::GroupScore* message) {
  message->set_group(score.group);
  message->set_size(score.size);
  message->set_entropy_nats(score.entropy);
  message->set_gain_nats(score.gain);
  message->set_rank(score.rank);
  AddDirections(score.unobserved, message->mutable_unobserved());
  message->set_in_table(std::find(tables.begin(), tables.end(), score.group) !=
                        tables.end());
}

void FillResiduals(const ResidualStatistics& residuals,
                   v1::ResidualStatistics* message) {
  message->set_observations(residuals.observations);
  message->set_inliers(residuals.inliers);
  message->set_not_projectable(residuals.not_projectable);
  message->set_outliers(residuals.outliers);
  message->set_landmarks(residuals.landmarks);
  message->set_landmarks_used(residuals.landmarks_used);
  message->set_reprojection_rms_px(residuals.reprojection_rms_px);
  message->set_reprojection_median_px(residuals.reprojection_median_px);
  message->mutable_inertial_rms()->Add(residuals.inertial_rms.begin(),
                                       residuals.inertial_rms.end());
  message->set_many_outliers(residuals.many_outliers);
  message->set_fit(residuals.fit);
  message->set_imu_gaps(residuals.imu_gaps);
  message->set_longest_imu_gap_s(residuals.longest_imu_gap_s);
}

std::string ReasonText(const TableAbsence& absence) {
  const std::string rival =
      absence.rival
          ? fmt::format("{}~{}", absence.rival->session, absence.rival->index)
          : "a segment that was dropped since";
  switch (absence.cause) {
    case AbsenceCause::kSaysTooLittle:
      return "insufficient gain";
    case AbsenceCause::kOthersSayMore:
      return "outranked by all entries of the full table, the last of which "
             "is " +
             rival;
    case AbsenceCause::kPushedOut:
      return "replaced by " + rival;
    case AbsenceCause::kTooOld:
      return "older than the rig's table_max_age";
    case AbsenceCause::kDeviceChanged:
      return "from before a device change";
    case AbsenceCause::kDataEvicted:
      return "its data was evicted by a quota";
    case AbsenceCause::kUnusable:
      return "unusable; see the segment's problem";
    case AbsenceCause::kDoesNotFit:
      return fmt::format(
          "does not fit: its residuals are {:.3g} times what is expected, and "
          "up to {:.3g} is usual for this rig",
          absence.fit.value_or(0),
          absence.fit_limit.value_or(0));
    case AbsenceCause::kManyOutliers:
      return "more than a fifth of its observations are outliers";
  }
  return "unknown to this program";
}

v1::TableExclusion::Cause EncodeCause(AbsenceCause cause) {
  switch (cause) {
    case AbsenceCause::kSaysTooLittle:
      return v1::TableExclusion::INSUFFICIENT_GAIN;
    case AbsenceCause::kOthersSayMore:
      return v1::TableExclusion::OUTRANKED;
    case AbsenceCause::kPushedOut:
      return v1::TableExclusion::REPLACED;
    case AbsenceCause::kTooOld:
      return v1::TableExclusion::TOO_OLD;
    case AbsenceCause::kDeviceChanged:
      return v1::TableExclusion::DEVICE_CHANGED;
    case AbsenceCause::kDataEvicted:
      return v1::TableExclusion::DATA_EVICTED;
    case AbsenceCause::kUnusable:
      return v1::TableExclusion::UNUSABLE;
    case AbsenceCause::kDoesNotFit:
      return v1::TableExclusion::DOES_NOT_FIT;
    case AbsenceCause::kManyOutliers:
      return v1::TableExclusion::MANY_OUTLIERS;
  }
  // Written by a newer program.
  return v1::TableExclusion::CAUSE_UNSPECIFIED;
}

}  // namespace

v1::TableExclusion Encode(const std::string& rig, const TableAbsence& absence) {
  v1::TableExclusion message;
  message.set_group(absence.group);
  message.set_reason(ReasonText(absence));
  SetTime(absence.time_ns, message.mutable_time());
  message.set_cause(EncodeCause(absence.cause));
  if (absence.rival) message.set_rival(SegmentName(rig, *absence.rival));
  if (absence.rival_entropy) {
    message.set_rival_entropy_nats(*absence.rival_entropy);
  }
  if (absence.fit) message.set_fit(*absence.fit);
  if (absence.fit_limit) message.set_fit_limit(*absence.fit_limit);
  return message;
}

v1::Rig Encode(const StoredRig& rig) {
  v1::Rig message = ToProto(rig.rig);
  PutPolicy(rig.policy, &message);
  message.mutable_labels()->insert(rig.labels.begin(), rig.labels.end());
  SetTime(rig.create_time_ns, message.mutable_create_time());
  return message;
}

v1::Segment Encode(const StoredSegment& segment) {
  v1::Segment message;
  message.set_name(SegmentName(segment.rig, segment.key));
  message.set_state(EncodeState(segment.state));
  message.set_has_data(segment.has_data);
  message.set_payload_bytes(segment.payload_bytes);
  SetTime(segment.receive_time_ns, message.mutable_receive_time());
  message.set_keyframes(segment.keyframes);
  message.set_imu_samples(segment.imu_samples);
  message.set_landmarks(segment.landmarks);
  message.set_observations(segment.observations);
  message.set_calibration_version(segment.calibration_version);
  message.set_start_ns(segment.start_ns);
  message.set_end_ns(segment.end_ns);
  message.set_sequence(segment.sequence);
  message.set_problem(segment.problem);
  if (segment.temperature_c) message.set_temperature_c(*segment.temperature_c);
  if (!segment.information) return message;
  const SegmentInformation& information = *segment.information;
  for (const GroupScore& score : information.groups) {
    FillScore(score, segment.tables, message.add_scores());
  }
  FillResiduals(information.residuals, message.mutable_residuals());
  message.set_rank(information.rank);
  message.set_components(information.rank +
                         static_cast<int>(information.unobserved.size()));
  AddDirections(information.unobserved, message.mutable_unobserved());
  return message;
}

v1::Table Encode(const std::string& rig, const Table& table) {
  v1::Table message;
  message.set_name(ChildName(rig, "tables", table.group));
  message.set_capacity(table.capacity);
  for (const TableEntry& entry : table.entries) {
    v1::Table::Entry* added = message.add_entries();
    added->set_segment(SegmentName(rig, entry.key));
    added->set_entropy_nats(entry.entropy);
    added->set_gain_nats(entry.gain);
    added->set_sequence(entry.sequence);
  }
  message.set_scored(table.scored);
  message.set_starved(table.starved());
  return message;
}

}  // namespace selfcal::server
