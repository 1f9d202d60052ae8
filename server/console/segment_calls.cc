#include "proto/convert.h"
#include "proto/resource_names.h"
#include "selfcal/v1/segment.pb.h"
#include "server/console/call.h"
#include "server/console/json.h"
#include "server/encode/encode.h"
#include "server/encode/segment_filter.h"
#include "server/store/status_macros.h"

namespace selfcal::server {
namespace {

// The segment that the address names, for a caller who may ask this of it.
template <typename Request>
absl::StatusOr<SegmentNameParts> SegmentOf(const Call& call) {
  Request request;
  request.set_name(RigName(call.parts.at(0)) + "/segments/" + call.parts.at(1));
  SELFCAL_RETURN_IF_ERROR(Authorise(call.request.caller, request));
  const auto parts = ParseSegmentName(request.name());
  if (parts) return *parts;
  return absl::InvalidArgumentError(
      "a segment's name is rigs/{rig}/segments/{session}~{index}; in an "
      "address a '%' of the session stands as %25");
}

// For a list, which shows no directions: they are nine tenths of the bytes.
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
  v1::ListTablesRequest request;
  request.set_parent(RigName(call.parts.at(0)));
  SELFCAL_RETURN_IF_ERROR(Authorise(call.request.caller, request));
  SELFCAL_ASSIGN_OR_RETURN(const std::string rig, RigOf(call));
  SELFCAL_ASSIGN_OR_RETURN(const auto tables,
                           call.context.store->GetTables(rig));
  v1::ListTablesResponse response;
  for (const Table& table : tables) {
    *response.add_tables() = Encode(rig, table);
  }
  return JsonResponse(response);
}

Answer ListSegments(const Call& call) {
  v1::ListSegmentsRequest request;
  request.set_parent(RigName(call.parts.at(0)));
  SELFCAL_RETURN_IF_ERROR(Authorise(call.request.caller, request));
  SELFCAL_ASSIGN_OR_RETURN(const std::string rig, RigOf(call));
  SegmentQuery query;
  SELFCAL_RETURN_IF_ERROR(ParseSegmentFilter(call.Query("filter"), &query));
  SELFCAL_RETURN_IF_ERROR(ParseSegmentOrder(call.Query("order_by"), &query));
  SELFCAL_ASSIGN_OR_RETURN(const Page page, PageOf(call));
  SELFCAL_ASSIGN_OR_RETURN(const auto listed,
                           call.context.store->ListSegments(rig, query, page));
  v1::ListSegmentsResponse response;
  for (const StoredSegment& segment : listed.items) {
    *response.add_segments() = EncodeBriefly(segment);
  }
  response.set_next_page_token(listed.next_token);
  return JsonResponse(response);
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
