#include <optional>

#include "proto/resource_names.h"
#include "selfcal/v1/activity_service.grpc.pb.h"
#include "server/domain/clock.h"
#include "server/encode/encode.h"
#include "server/encode/encode_parts.h"
#include "server/encode/table_fill.h"
#include "server/service/caller.h"
#include "server/service/errors.h"
#include "server/service/paging.h"
#include "server/service/services.h"
#include "server/service/traffic.h"

namespace selfcal::server {
namespace {

v1::SegmentTraffic Encode(const TrafficCounts& counts) {
  v1::SegmentTraffic message;
  message.set_streams(counts.streams);
  message.set_stored(counts.stored);
  message.set_rejected(counts.rejected);
  message.set_stored_per_minute(counts.stored_per_minute);
  return message;
}

class ActivityService final : public v1::ActivityService::Service {
 public:
  explicit ActivityService(const ServiceContext& context) : context_(context) {}

  grpc::Status ListActivity(grpc::ServerContext* call,
                            const v1::ListActivityRequest* request,
                            v1::ListActivityResponse* response) override {
    return Authorised(context_, *call, *request, [&]() -> grpc::Status {
      RigQuery query;
      query.order = RigQuery::Order::kLastSeen;
      query.descending = true;
      const grpc::Status filled = FillPage(
          *request,
          "",
          [&](const Page& page) {
            return context_.store->ListRigSummaries(query, page);
          },
          [&](const RigSummary& rig, v1::ListActivityResponse* to) {
            AddRig(rig, to->add_rigs());
            return grpc::Status::OK;
          },
          response);
      SetTime(NowNs(), response->mutable_time());
      SetTime(context_.traffic->start_time_ns(),
              response->mutable_start_time());
      *response->mutable_traffic() = Encode(context_.traffic->OfAll());
      return filled;
    });
  }

 private:
  void AddRig(const RigSummary& rig, v1::RigActivity* message) {
    message->set_name(RigName(rig.rig));
    if (rig.last_seen_ns != 0) {
      SetTime(rig.last_seen_ns, message->mutable_last_seen());
    }
    message->set_active_version(rig.active_version);
    SetTime(rig.active_since_ns, message->mutable_active_since());
    const TableFill fill = FillOf(rig.tables);
    message->set_table_entries(fill.entries);
    message->set_table_capacity(fill.capacity);
    *message->mutable_traffic() = Encode(context_.traffic->Of(rig.rig));
    const bool at_work =
        rig.newest_run != 0 && (rig.run_state == RunState::kPending ||
                                rig.run_state == RunState::kRunning);
    if (!at_work) return;
    if (const auto update = Now(rig.rig, rig.newest_run)) {
      *message->mutable_run() =
          server::Encode(update->run, update->progress, nullptr);
    }
  }

  // Returns the first update of a watch, which is the present state; nullopt if
  // the run has ended in the meantime.
  std::optional<RunUpdate> Now(const std::string& rig, std::int64_t run) {
    std::optional<RunUpdate> now;
    const auto watch =
        context_.pipeline->WatchRun(rig, run, [&](const RunUpdate& update) {
          if (!now) now = update;
        });
    const bool at_work = now && (now->run.state == RunState::kPending ||
                                 now->run.state == RunState::kRunning);
    return at_work ? now : std::nullopt;
  }

  ServiceContext context_;
};

}  // namespace

std::unique_ptr<grpc::Service> MakeActivityService(
    const ServiceContext& context) {
  return std::make_unique<ActivityService>(context);
}

}  // namespace selfcal::server
