#include "proto/convert.h"
#include "proto/resource_names.h"
#include "selfcal/v1/segment.pb.h"
#include "server/console/asked.h"
#include "server/encode/encode.h"
#include "server/encode/segment_filter.h"
#include "server/store/status_macros.h"

namespace selfcal::server {
namespace {

// Encodes a segment for a list, without its unobserved directions, which are
// nine tenths of the bytes and are not shown.
v1::Segment EncodeBriefly(const StoredSegment& segment) {
  v1::Segment message = Encode(segment);
  message.clear_unobserved();
  for (v1::GroupScore& score : *message.mutable_scores()) {
    score.clear_unobserved();
  }
  return message;
}

}  // namespace

Answer ListTables(const Call& call) {
  SELFCAL_ASSIGN_OR_RETURN(const std::string rig,
                           ParentOf<v1::ListTablesRequest>(call));
  SELFCAL_ASSIGN_OR_RETURN(const auto tables,
                           call.context.store->GetTables(rig));
  v1::ListTablesResponse response;
  for (const Table& table : tables) {
    *response.add_tables() = Encode(rig, table);
  }
  return JsonResponse(response);
}

Answer ListSegments(const Call& call) {
  SELFCAL_ASSIGN_OR_RETURN(const std::string rig,
                           ParentOf<v1::ListSegmentsRequest>(call));
  SegmentQuery query;
  SELFCAL_RETURN_IF_ERROR(ParseSegmentFilter(call.Query("filter"), &query));
  SELFCAL_RETURN_IF_ERROR(ParseSegmentOrder(call.Query("order_by"), &query));
  SELFCAL_ASSIGN_OR_RETURN(const Page page, PageOf(call));
  return PageAnswer<v1::ListSegmentsResponse>(
      call.context.store->ListSegments(rig, query, page),
      [](const StoredSegment& segment, auto* response) {
        *response->add_segments() = EncodeBriefly(segment);
        return absl::OkStatus();
      });
}

Answer GetSegment(const Call& call) {
  SELFCAL_ASSIGN_OR_RETURN(const SegmentNameParts name,
                           SegmentOf<v1::GetSegmentRequest>(call));
  SELFCAL_ASSIGN_OR_RETURN(const StoredSegment segment,
                           call.context.store->GetSegment(name.rig, name.key));
  return JsonResponse(Encode(segment));
}

Answer GetSegmentData(const Call& call) {
  SELFCAL_ASSIGN_OR_RETURN(const SegmentNameParts name,
                           SegmentOf<v1::GetSegmentDataRequest>(call));
  SELFCAL_ASSIGN_OR_RETURN(
      const MotionSegment data,
      call.context.store->GetSegmentData(name.rig, name.key));
  return JsonResponse(ToProto(data));
}

}  // namespace selfcal::server
