#include <algorithm>

#include "proto/resource_names.h"
#include "selfcal/v1/segment.pb.h"
#include "server/console/asked.h"
#include "server/console/motion.h"
#include "server/encode/versions.h"
#include "server/store/status_macros.h"

namespace selfcal::server {
namespace {

// Limit on the positions of one session that a page draws, however long it is;
// each segment keeps its first and last position.
constexpr std::int64_t kPointsOfSession = 16'000;

absl::StatusOr<StoredCalibration> VersionOf(const Call& call,
                                            const std::string& rig,
                                            std::int64_t otherwise) {
  const std::string version = call.Query("version");
  return version.empty() ? call.context.store->GetCalibration(rig, otherwise)
                         : ReadVersion(call, version);
}

}  // namespace

Answer ListSessions(const Call& call) {
  SELFCAL_ASSIGN_OR_RETURN(const std::string rig,
                           ParentOf<v1::ListSegmentsRequest>(call));
  SELFCAL_ASSIGN_OR_RETURN(const Page page, PageOf(call));
  return PageAnswer<console::ListSessionsResponse>(
      call.context.store->ListSessions(rig, page),
      [&](const SessionSummary& session, auto* response) {
        *response->add_sessions() = Encode(rig, session);
        return absl::OkStatus();
      });
}

Answer GetTrajectory(const Call& call) {
  SELFCAL_ASSIGN_OR_RETURN(const std::string rig,
                           ParentOf<v1::ListSegmentsRequest>(call));
  const auto name = ParseChildName(
      RigName(call.parts.at(0)) + "/sessions/" + call.parts.at(1), "sessions");
  if (!name) {
    return absl::InvalidArgumentError(
        "in an address, a session is written as in the name of its segments, "
        "with %25 for a '%'");
  }
  const std::string& session = name->id;
  SELFCAL_ASSIGN_OR_RETURN(const Page page, PageOf(call));
  SELFCAL_ASSIGN_OR_RETURN(const SessionSummary summary,
                           call.context.store->GetSession(rig, session));
  SELFCAL_ASSIGN_OR_RETURN(
      const auto listed,
      call.context.store->ListSessionSegments(rig, session, page));
  const auto points = std::clamp<std::int64_t>(
      kPointsOfSession / std::max<std::int64_t>(1, summary.segments),
      2,
      kMaxPathPoints);
  console::SessionTrajectory response;
  *response.mutable_session() = Encode(rig, summary);
  for (const SessionSegment& segment : listed.items) {
    *response.add_segments() = Encode(rig, segment, static_cast<int>(points));
  }
  response.set_next_page_token(listed.next_token);
  return JsonResponse(response);
}

Answer ListAbsences(const Call& call) {
  SELFCAL_ASSIGN_OR_RETURN(const SegmentNameParts name,
                           SegmentOf<v1::GetSegmentRequest>(call));
  SELFCAL_ASSIGN_OR_RETURN(
      const auto absences,
      call.context.store->ListAbsences(name.rig, name.key));
  console::ListAbsencesResponse response;
  for (const TableAbsence& absence : absences) {
    *response.add_absences() = Encode(name.rig, absence);
  }
  return JsonResponse(response);
}

Answer GetInformation(const Call& call) {
  SELFCAL_ASSIGN_OR_RETURN(const SegmentNameParts name,
                           SegmentOf<v1::GetSegmentRequest>(call));
  Store* store = call.context.store;
  SELFCAL_ASSIGN_OR_RETURN(const StoredSegment segment,
                           store->GetSegment(name.rig, name.key));
  if (!segment.information) return JsonResponse(console::SegmentInformation());
  SELFCAL_ASSIGN_OR_RETURN(const StoredRig rig, store->GetRig(name.rig));
  return JsonResponse(Encode(rig.rig, *segment.information));
}

Answer GetResiduals(const Call& call) {
  SELFCAL_ASSIGN_OR_RETURN(const SegmentNameParts name,
                           SegmentOf<v1::GetSegmentDataRequest>(call));
  Store* store = call.context.store;
  SELFCAL_ASSIGN_OR_RETURN(const MotionSegment data,
                           store->GetSegmentData(name.rig, name.key));
  SELFCAL_ASSIGN_OR_RETURN(const StoredRig rig, store->GetRig(name.rig));
  SELFCAL_ASSIGN_OR_RETURN(const StoredCalibration version,
                           VersionOf(call, name.rig, data.calibration_version));
  console::SegmentResiduals response =
      Encode(EvaluateResiduals(rig.rig, version.theta, data),
             data,
             static_cast<int>(version.theta.cameras.size()));
  response.set_calibration_version(version.version);
  return JsonResponse(response);
}

}  // namespace selfcal::server
