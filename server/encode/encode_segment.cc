#include <fmt/format.h>

#include <algorithm>

#include "proto/convert.h"
#include "proto/resource_names.h"
#include "server/convert/convert.h"
#include "server/encode/encode.h"
#include "server/encode/set_time.h"
#include "server/store/rig_policy.h"

namespace selfcal::server {
namespace {

v1::Segment::State EncodeSegmentState(SegmentState state) {
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

bool InTable(const StoredSegment& segment, const std::string& group) {
  return std::find(segment.tables.begin(), segment.tables.end(), group) !=
         segment.tables.end();
}

std::string ReasonText(const Exclusion& exclusion) {
  const std::string rival =
      exclusion.rival
          ? fmt::format(
                "{}~{}", exclusion.rival->session, exclusion.rival->index)
          : "a segment that was dropped since";
  switch (exclusion.cause) {
    case ExclusionCause::kInsufficientGain:
      return "insufficient gain";
    case ExclusionCause::kOutranked:
      return "outranked by all entries of the full table, the last of which "
             "is " +
             rival;
    case ExclusionCause::kReplaced:
      return "replaced by " + rival;
    case ExclusionCause::kTooOld:
      return "older than the rig's table_max_age";
    case ExclusionCause::kDeviceChanged:
      return "from before a device change";
    case ExclusionCause::kDataEvicted:
      return "its data was evicted by a quota";
    case ExclusionCause::kUnusable:
      return "unusable; see the segment's problem";
    case ExclusionCause::kDoesNotFit:
      return fmt::format(
          "does not fit: its residuals are {:.3g} times what is expected, and "
          "up to {:.3g} is usual for this rig",
          exclusion.fit.value_or(0),
          exclusion.fit_limit.value_or(0));
    case ExclusionCause::kManyOutliers:
      return "more than a fifth of its observations are outliers";
  }
  return "unknown to this program";
}

v1::TableExclusion::Cause EncodeCause(ExclusionCause cause) {
  switch (cause) {
    case ExclusionCause::kInsufficientGain:
      return v1::TableExclusion::INSUFFICIENT_GAIN;
    case ExclusionCause::kOutranked:
      return v1::TableExclusion::OUTRANKED;
    case ExclusionCause::kReplaced:
      return v1::TableExclusion::REPLACED;
    case ExclusionCause::kTooOld:
      return v1::TableExclusion::TOO_OLD;
    case ExclusionCause::kDeviceChanged:
      return v1::TableExclusion::DEVICE_CHANGED;
    case ExclusionCause::kDataEvicted:
      return v1::TableExclusion::DATA_EVICTED;
    case ExclusionCause::kUnusable:
      return v1::TableExclusion::UNUSABLE;
    case ExclusionCause::kDoesNotFit:
      return v1::TableExclusion::DOES_NOT_FIT;
    case ExclusionCause::kManyOutliers:
      return v1::TableExclusion::MANY_OUTLIERS;
  }
  // Written by a newer program.
  return v1::TableExclusion::CAUSE_UNSPECIFIED;
}

}  // namespace

v1::TableExclusion Encode(const std::string& rig, const Exclusion& exclusion) {
  v1::TableExclusion message;
  message.set_group(exclusion.group);
  message.set_reason(ReasonText(exclusion));
  SetTime(exclusion.time_ns, message.mutable_time());
  message.set_cause(EncodeCause(exclusion.cause));
  if (exclusion.rival) message.set_rival(SegmentName(rig, *exclusion.rival));
  if (exclusion.rival_entropy) {
    message.set_rival_entropy_nats(*exclusion.rival_entropy);
  }
  if (exclusion.fit) message.set_fit(*exclusion.fit);
  if (exclusion.fit_limit) message.set_fit_limit(*exclusion.fit_limit);
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
  message.set_state(EncodeSegmentState(segment.state));
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
  if (segment.motion) {
    v1::Segment::Motion* motion = message.mutable_motion();
    motion->set_angular_rate(segment.motion->angular_rate_radps);
    motion->set_acceleration(segment.motion->acceleration_mps2);
  }
  if (!segment.information) return message;
  const SegmentInformation& information = *segment.information;
  for (const GroupScore& score : information.groups) {
    v1::GroupScore* added = message.add_scores();
    *added = ToProto(score);
    added->set_in_table(InTable(segment, score.group));
  }
  *message.mutable_residuals() = ToProto(information.residuals);
  message.set_rank(information.rank);
  message.set_components(information.rank +
                         static_cast<int>(information.unobserved.size()));
  ToProto(information.unobserved, message.mutable_unobserved());
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
