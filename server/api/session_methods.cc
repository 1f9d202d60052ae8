#include <algorithm>

#include "proto/resource_names.h"
#include "selfcal/v1/session.pb.h"
#include "server/api/errors.h"
#include "server/api/methods.h"
#include "server/api/paging.h"
#include "server/encode/encode_session.h"
#include "server/status/status_macros.h"

namespace selfcal::server {
namespace {

// Positions of one session, however long it was; each segment keeps its ends.
constexpr std::int64_t kPointsOfSession = 16'000;

absl::StatusOr<v1::ListSessionsResponse> ListSessions(
    const ApiContext& context,
    const Call&,
    const v1::ListSessionsRequest& request) {
  const auto rig = ParseRigName(request.parent());
  if (!rig) return BadName("parent", "rigs/{rig}");
  return FillPage<v1::ListSessionsResponse>(
      request,
      request.parent(),
      [&](const Page& page) { return context.store->ListSessions(*rig, page); },
      [&](const SessionSummary& session, v1::ListSessionsResponse* to) {
        *to->add_sessions() = Encode(*rig, session);
        return absl::OkStatus();
      });
}

absl::StatusOr<v1::SessionTrajectory> GetTrajectory(
    const ApiContext& context,
    const Call&,
    const v1::GetTrajectoryRequest& request) {
  const auto name = ParseChildName(request.name(), "sessions");
  if (!name) {
    return BadName("name",
                   "rigs/{rig}/sessions/{session}, {session} encoded as in the "
                   "names of its segments");
  }
  const auto summary = context.store->GetSession(name->rig, name->id);
  if (!summary.ok()) {
    return About(summary.status(), {kSessionType, request.name(), {}});
  }
  const auto points = std::clamp<std::int64_t>(
      kPointsOfSession / std::max<std::int64_t>(1, summary->segments),
      2,
      kMaxPathPoints);
  SELFCAL_ASSIGN_OR_RETURN(
      v1::SessionTrajectory response,
      FillPage<v1::SessionTrajectory>(
          request,
          request.name(),
          [&](const Page& page) {
            return context.store->ListSessionSegments(
                name->rig, name->id, page);
          },
          [&](const SessionSegment& segment, v1::SessionTrajectory* to) {
            *to->add_segments() =
                Encode(name->rig, segment, static_cast<int>(points));
            return absl::OkStatus();
          }));
  *response.mutable_session() = Encode(name->rig, *summary);
  return response;
}

}  // namespace

void AddSessionMethods(Methods* methods) {
  methods->Add(ListSessions);
  methods->Add(GetTrajectory);
}

}  // namespace selfcal::server
