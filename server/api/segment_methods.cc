#include <google/protobuf/empty.pb.h>

#include <algorithm>
#include <optional>

#include "core/information/segment_residuals.h"
#include "proto/convert.h"
#include "proto/resource_names.h"
#include "proto/safe_text.h"
#include "selfcal/v1/segment.pb.h"
#include "server/api/errors.h"
#include "server/api/list_parent.h"
#include "server/api/methods.h"
#include "server/api/paging.h"
#include "server/api/segment_stream.h"
#include "server/encode/encode.h"
#include "server/encode/encode_session.h"
#include "server/encode/reason.h"
#include "server/encode/segment_filter.h"
#include "server/status/status_macros.h"

namespace selfcal::server {
namespace {

absl::StatusOr<SegmentNameParts> ParseSegment(const std::string& name) {
  const auto parts = ParseSegmentName(name);
  if (!parts) return BadName("name", "rigs/{rig}/segments/{session}~{index}");
  return *parts;
}

void ClearDirections(v1::Segment* segment) {
  segment->clear_unobserved();
  for (v1::GroupScore& score : *segment->mutable_scores()) {
    score.clear_unobserved();
  }
}

absl::StatusOr<v1::ListSegmentsResponse> ListSegments(
    const ApiContext& context,
    const Call& call,
    const v1::ListSegmentsRequest& request) {
  SELFCAL_ASSIGN_OR_RETURN(
      const ListParent parent,
      ReadListParent(call, request.parent(), request.rig_filter()));
  SegmentQuery query;
  if (const auto filter = ParseSegmentFilter(request.filter(), &query);
      !filter.ok()) {
    return About(filter, {kSegmentType, "", "filter"});
  }
  if (const auto order = ParseSegmentOrder(request.order_by(), &query);
      !order.ok()) {
    return About(order, {kSegmentType, "", "order_by"});
  }
  return FillPage<v1::ListSegmentsResponse>(
      request,
      request.parent(),
      [&](const Page& page) {
        return context.store->ListSegments(parent.rig, query, page, parent.of);
      },
      [&](const StoredSegment& segment, v1::ListSegmentsResponse* to) {
        v1::Segment* added = to->add_segments();
        *added = Encode(segment);
        if (request.view() == v1::ListSegmentsRequest::BASIC)
          ClearDirections(added);
        return absl::OkStatus();
      });
}

absl::StatusOr<v1::Segment> GetSegment(const ApiContext& context,
                                       const Call&,
                                       const v1::GetSegmentRequest& request) {
  SELFCAL_ASSIGN_OR_RETURN(const SegmentNameParts parts,
                           ParseSegment(request.name()));
  const Subject subject{kSegmentType, request.name(), {}};
  const auto segment = context.store->GetSegment(parts.rig, parts.key);
  if (!segment.ok()) return About(segment.status(), subject);
  const auto exclusions = context.store->ListExclusions(parts.rig, parts.key);
  if (!exclusions.ok()) return About(exclusions.status(), subject);
  v1::Segment response = Encode(*segment);
  for (const Exclusion& exclusion : *exclusions) {
    *response.add_exclusions() = Encode(parts.rig, exclusion);
  }
  return response;
}

absl::StatusOr<v1::MotionSegment> GetSegmentData(
    const ApiContext& context,
    const Call&,
    const v1::GetSegmentDataRequest& request) {
  SELFCAL_ASSIGN_OR_RETURN(const SegmentNameParts parts,
                           ParseSegment(request.name()));
  const auto data = context.store->GetSegmentData(parts.rig, parts.key);
  if (!data.ok()) {
    return About(data.status(), {kSegmentType, request.name(), {}});
  }
  return ToProto(*data);
}

absl::StatusOr<v1::SegmentInformation> GetSegmentInformation(
    const ApiContext& context,
    const Call&,
    const v1::GetSegmentInformationRequest& request) {
  SELFCAL_ASSIGN_OR_RETURN(const SegmentNameParts parts,
                           ParseSegment(request.name()));
  const auto segment = context.store->GetSegment(parts.rig, parts.key);
  if (!segment.ok()) {
    return About(segment.status(), {kSegmentType, request.name(), {}});
  }
  if (!segment->information) return v1::SegmentInformation();
  SELFCAL_ASSIGN_OR_RETURN(const StoredRig rig,
                           context.store->GetRig(parts.rig));
  return Encode(rig.rig, *segment->information);
}

absl::StatusOr<v1::SegmentResiduals> GetSegmentResiduals(
    const ApiContext& context,
    const Call&,
    const v1::GetSegmentResidualsRequest& request) {
  SELFCAL_ASSIGN_OR_RETURN(const SegmentNameParts parts,
                           ParseSegment(request.name()));
  const Subject subject{kSegmentType, request.name(), {}};
  const auto data = context.store->GetSegmentData(parts.rig, parts.key);
  if (!data.ok()) return About(data.status(), subject);
  SELFCAL_ASSIGN_OR_RETURN(const StoredRig rig,
                           context.store->GetRig(parts.rig));
  if (request.calibration_version() < 0) {
    return InvalidFields({{"calibration_version",
                           "is negative; send 0 for the version with which "
                           "the segment was estimated"}});
  }
  const std::int64_t number = request.calibration_version() == 0
                                  ? data->calibration_version
                                  : request.calibration_version();
  const auto version = context.store->GetCalibration(parts.rig, number);
  if (!version.ok()) {
    return About(version.status(),
                 {kCalibrationType,
                  ChildName(parts.rig, "calibrations", std::to_string(number)),
                  "calibration_version"});
  }
  v1::SegmentResiduals response =
      Encode(EvaluateResiduals(rig.rig, version->theta, *data),
             *data,
             static_cast<int>(version->theta.cameras.size()));
  response.set_calibration_version(number);
  return response;
}

absl::StatusOr<v1::ListTablesResponse> ListTables(
    const ApiContext& context,
    const Call&,
    const v1::ListTablesRequest& request) {
  const auto rig = ParseRigName(request.parent());
  if (!rig) return BadName("parent", "rigs/{rig}");
  const auto tables = context.store->GetTables(*rig);
  if (!tables.ok()) {
    return About(tables.status(), {kRigType, request.parent(), {}});
  }
  v1::ListTablesResponse response;
  for (const Table& table : *tables) {
    *response.add_tables() = Encode(*rig, table);
  }
  return response;
}

absl::StatusOr<v1::Table> GetTable(const ApiContext& context,
                                   const Call&,
                                   const v1::GetTableRequest& request) {
  const auto parts = ParseChildName(request.name(), "tables");
  if (!parts) return BadName("name", "rigs/{rig}/tables/{group}");
  const Subject subject{kTableType, request.name(), {}};
  const auto tables = context.store->GetTables(parts->rig);
  if (!tables.ok()) return About(tables.status(), subject);
  const auto table =
      std::find_if(tables->begin(), tables->end(), [&](const Table& t) {
        return t.group == parts->id;
      });
  if (table == tables->end()) {
    return About(absl::NotFoundError("the rig has no group of parameters '" +
                                     SafeLine(parts->id, 100) + "'"),
                 subject);
  }
  return Encode(parts->rig, *table);
}

absl::Status DownloadSegments(
    const ApiContext& context,
    const Call& call,
    const v1::DownloadSegmentsRequest& request,
    const Writer<v1::DownloadSegmentsResponse>& write) {
  const auto rig = ParseRigName(request.parent());
  if (!rig) return BadName("parent", "rigs/{rig}");
  SegmentQuery query;
  if (const auto filter = ParseSegmentFilter(request.filter(), &query);
      !filter.ok()) {
    return About(filter, {kSegmentType, "", "filter"});
  }
  query.has_data = true;
  query.descending = false;
  Page page{kMaxPageSize, ""};
  do {
    const auto listed = context.store->ListSegments(*rig, query, page);
    if (!listed.ok()) {
      return About(listed.status(), {kRigType, request.parent(), "parent"});
    }
    for (const StoredSegment& segment : listed->items) {
      const auto data = context.store->GetSegmentData(*rig, segment.key);
      // Dropped since the list was made.
      if (absl::IsFailedPrecondition(data.status()) ||
          absl::IsNotFound(data.status())) {
        continue;
      }
      if (!data.ok()) return data.status();
      v1::DownloadSegmentsResponse response;
      response.set_name(SegmentName(*rig, segment.key));
      *response.mutable_segment() = ToProto(*data);
      if (!write(response) || call.cancelled()) {
        return absl::CancelledError("the caller has disconnected");
      }
    }
    page.token = listed->next_token;
  } while (!page.token.empty());
  return absl::OkStatus();
}

absl::StatusOr<google::protobuf::Empty> DeleteSegment(
    const ApiContext& context,
    const Call& call,
    const v1::DeleteSegmentRequest& request) {
  SELFCAL_ASSIGN_OR_RETURN(const SegmentNameParts parts,
                           ParseSegment(request.name()));
  if (!IsReason(request.reason())) {
    return InvalidFields({{"reason", std::string(kReasonRule)}});
  }
  const absl::Status deleted = context.pipeline->DeleteSegment(
      parts.rig, parts.key, call.caller.name, request.reason());
  if (!deleted.ok()) return About(deleted, {kSegmentType, request.name(), {}});
  return google::protobuf::Empty();
}

absl::StatusOr<v1::QuarantineSegmentsResponse> QuarantineSegments(
    const ApiContext& context,
    const Call& call,
    const v1::QuarantineSegmentsRequest& request) {
  const auto rig = ParseRigName(request.parent());
  if (!rig) return BadName("parent", "rigs/{rig}");
  if (request.session().empty()) {
    return InvalidFields({{"session", "is empty; name the session"}});
  }
  if (!IsReason(request.reason())) {
    return InvalidFields({{"reason", std::string(kReasonRule)}});
  }
  const auto commit = context.pipeline->QuarantineSegments(
      *rig,
      request.session(),
      request.has_index() ? std::optional(request.index()) : std::nullopt,
      call.caller.name,
      request.reason());
  if (!commit.ok()) {
    return About(commit.status(),
                 {kSegmentType,
                  request.parent() + "/segments/" + request.session(),
                  {}});
  }
  v1::QuarantineSegmentsResponse response;
  response.set_quarantined(commit->quarantined);
  response.set_unusable(commit->unusable);
  return response;
}

}  // namespace

void AddSegmentMethods(Methods* methods) {
  methods->AddExchange<v1::StreamSegmentsRequest, v1::StreamSegmentsResponse>(
      MakeSegmentStream);
  methods->Add(ListSegments);
  methods->Add(GetSegment);
  methods->Add(GetSegmentData);
  methods->Add(GetSegmentInformation);
  methods->Add(GetSegmentResiduals);
  methods->Add(ListTables);
  methods->Add(GetTable);
  methods->Add(DownloadSegments);
  methods->Add(DeleteSegment);
  methods->Add(QuarantineSegments);
}

}  // namespace selfcal::server
