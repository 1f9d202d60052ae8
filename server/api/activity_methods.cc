#include <optional>

#include "proto/resource_names.h"
#include "selfcal/v1/activity_service.pb.h"
#include "selfcal/v1/rig.pb.h"
#include "server/api/errors.h"
#include "server/api/event_feed.h"
#include "server/api/methods.h"
#include "server/api/paging.h"
#include "server/api/read_rig_query.h"
#include "server/api/traffic.h"
#include "server/domain/clock.h"
#include "server/encode/encode.h"
#include "server/encode/encode_activity.h"
#include "server/encode/set_time.h"
#include "server/status/status_macros.h"

namespace selfcal::server {
namespace {

v1::SegmentTraffic EncodeTraffic(const TrafficCounts& counts) {
  v1::SegmentTraffic message;
  message.set_streams(counts.streams);
  message.set_stored(counts.stored);
  message.set_rejected(counts.rejected);
  message.set_stored_per_minute(counts.stored_per_minute);
  return message;
}

bool IsUnfinished(RunState state) {
  return state == RunState::kPending || state == RunState::kRunning;
}

// The run as it is now; nullopt if it has ended in the meantime.
std::optional<RunUpdate> CurrentRun(const ApiContext& context,
                                    const std::string& rig,
                                    std::int64_t run) {
  std::optional<RunUpdate> now;
  // A watch starts with the current state.
  const auto watch =
      context.pipeline->WatchRun(rig, run, [&](const RunUpdate& update) {
        if (!now) now = update;
      });
  return now && IsUnfinished(now->run.state) ? now : std::nullopt;
}

v1::RigActivity EncodeRig(const ApiContext& context, const RigSummary& rig) {
  v1::RigActivity message = Encode(rig, NowNs());
  *message.mutable_traffic() = EncodeTraffic(context.traffic->Of(rig.rig));
  if (rig.newest_run != 0 && IsUnfinished(rig.run_state)) {
    if (const auto update = CurrentRun(context, rig.rig, rig.newest_run)) {
      *message.mutable_run() = Encode(update->run, update->progress, nullptr);
    }
  }
  return message;
}

absl::StatusOr<v1::ListActivityResponse> ListActivity(
    const ApiContext& context,
    const Call& call,
    const v1::ListActivityRequest& request) {
  RigQuery query;
  query.order = RigQuery::Order::kLastSeen;
  query.descending = true;
  SELFCAL_RETURN_IF_ERROR(
      ReadRigQuery(call, request.filter(), request.order_by(), &query));
  query.with_alarms = request.with_alarms();
  SELFCAL_ASSIGN_OR_RETURN(
      v1::ListActivityResponse response,
      FillPage<v1::ListActivityResponse>(
          request,
          "",
          [&](const Page& page) {
            return context.store->ListRigSummaries(query, page);
          },
          [&](const RigSummary& rig, v1::ListActivityResponse* to) {
            *to->add_rigs() = EncodeRig(context, rig);
            return absl::OkStatus();
          }));
  SetTime(NowNs(), response.mutable_time());
  SetTime(context.traffic->start_time_ns(), response.mutable_start_time());
  if (!query.choice) {
    *response.mutable_traffic() = EncodeTraffic(context.traffic->OfAll());
  }
  return response;
}

// A rig that cannot be read now does not show.
bool MayRead(const RigRights& rights, Store* store, const std::string& rig) {
  if (rights.rigs.contains(rig)) return true;
  if (rights.labels.empty()) return false;
  const auto stored = store->GetRig(rig);
  return stored.ok() && Include(rights, rig, stored->labels);
}

absl::StatusOr<std::shared_ptr<void>> WatchChanges(
    const ApiContext& context,
    const Call& call,
    const v1::WatchChangesRequest& request,
    const Watch<v1::Change>& watch) {
  std::string rig;
  if (!request.parent().empty()) {
    const auto parsed = ParseRigName(request.parent());
    if (!parsed) return BadName("parent", "rigs/{rig}");
    const absl::Status found = context.store->GetRig(*parsed).status();
    if (!found.ok()) {
      return About(found, {kRigType, request.parent(), "parent"});
    }
    rig = *parsed;
  }
  const auto rights = RightsOf(call.caller, Role::kRead);
  const auto put = [watch, rights, store = context.store](
                       v1::Change::What what, const std::string& of) {
    const std::string name = of.empty() ? "" : RigName(of);
    watch.Put(std::to_string(what) + name,
              [=](v1::Change* to) -> absl::StatusOr<bool> {
                if (rights && !of.empty() && !MayRead(*rights, store, of)) {
                  return false;
                }
                to->set_what(what);
                to->set_rig(name);
                return true;
              });
  };
  watch.SetSummary([](v1::Change* to) -> absl::StatusOr<bool> {
    to->set_what(v1::Change::EVERYTHING);
    return true;
  });
  std::shared_ptr<void> subscription = context.feed->Subscribe(rig, put);
  // Sent at once, so that the reader knows that its watch stands: what changes
  // from now on is reported.
  put(v1::Change::EVERYTHING, "");
  return subscription;
}

absl::StatusOr<v1::Caller> GetCaller(const ApiContext& context,
                                     const Call& call,
                                     const v1::GetCallerRequest&) {
  v1::Caller response;
  response.set_name(call.caller.name);
  for (const Grant& grant : call.caller.grants) {
    v1::Caller::Grant* added = response.add_grants();
    added->set_role(std::string(RoleName(grant.role)));
    if (!grant.rig.empty()) added->set_rig(RigName(grant.rig));
    if (grant.label) {
      added->set_label(grant.label->first + "=" + grant.label->second);
    }
  }
  response.set_program_version(context.program_version);
  return response;
}

}  // namespace

void AddActivityMethods(Methods* methods) {
  methods->Add(ListActivity);
  methods->Add(WatchChanges);
  methods->Add(GetCaller);
}

}  // namespace selfcal::server
