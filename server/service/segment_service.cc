#include <algorithm>
#include <atomic>
#include <optional>

#include "proto/convert.h"
#include "proto/resource_names.h"
#include "selfcal/v1/segment.grpc.pb.h"
#include "server/encode/encode.h"
#include "server/encode/reason.h"
#include "server/encode/segment_filter.h"
#include "server/encode/shortened.h"
#include "server/service/caller.h"
#include "server/service/errors.h"
#include "server/service/paging.h"
#include "server/service/segment_call.h"
#include "server/service/services.h"

namespace selfcal::server {
namespace {

constexpr char kRigType[] = "selfcal.v1.Rig";
constexpr char kSegmentType[] = "selfcal.v1.Segment";
constexpr char kTableType[] = "selfcal.v1.Table";

// StreamSegments is asynchronous, because it responds when segments become
// durable; the other methods are synchronous.
using Service = v1::SegmentService::WithCallbackMethod_StreamSegments<
    v1::SegmentService::Service>;

class SegmentService final : public Service {
 public:
  explicit SegmentService(const ServiceContext& context) : context_(context) {}

  SegmentReactor* StreamSegments(grpc::CallbackServerContext* call) override {
    return StartSegmentCall(context_, call, &open_streams_);
  }

  grpc::Status ListSegments(grpc::ServerContext* call,
                            const v1::ListSegmentsRequest* request,
                            v1::ListSegmentsResponse* response) override {
    return Authorised(context_, *call, *request, [&]() -> grpc::Status {
      const auto rig = ParseRigName(request->parent());
      if (!rig) return BadName("parent", "rigs/{rig}");
      SegmentQuery query;
      if (const auto filter = ParseSegmentFilter(request->filter(), &query);
          !filter.ok()) {
        return ToGrpc(filter, {kSegmentType, "", "filter"});
      }
      if (const auto order = ParseSegmentOrder(request->order_by(), &query);
          !order.ok()) {
        return ToGrpc(order, {kSegmentType, "", "order_by"});
      }
      return FillPage(
          *request,
          request->parent(),
          [&](const Page& page) {
            return context_.store->ListSegments(*rig, query, page);
          },
          [](const StoredSegment& segment, v1::ListSegmentsResponse* to) {
            *to->add_segments() = Encode(segment);
            return grpc::Status::OK;
          },
          response);
    });
  }

  grpc::Status GetSegment(grpc::ServerContext* call,
                          const v1::GetSegmentRequest* request,
                          v1::Segment* response) override {
    return Authorised(context_, *call, *request, [&]() -> grpc::Status {
      const auto parts = ParseSegmentName(request->name());
      if (!parts) {
        return BadName("name", "rigs/{rig}/segments/{session}~{index}");
      }
      const auto segment = context_.store->GetSegment(parts->rig, parts->key);
      if (!segment.ok()) {
        return ToGrpc(segment.status(), {kSegmentType, request->name(), {}});
      }
      *response = Encode(*segment);
      const auto absences =
          context_.store->ListAbsences(parts->rig, parts->key);
      if (!absences.ok()) {
        return ToGrpc(absences.status(), {kSegmentType, request->name(), {}});
      }
      for (const TableAbsence& absence : *absences) {
        *response->add_exclusions() = Encode(absence);
      }
      return grpc::Status::OK;
    });
  }

  grpc::Status GetSegmentData(grpc::ServerContext* call,
                              const v1::GetSegmentDataRequest* request,
                              v1::MotionSegment* response) override {
    return Authorised(context_, *call, *request, [&]() -> grpc::Status {
      const auto parts = ParseSegmentName(request->name());
      if (!parts) {
        return BadName("name", "rigs/{rig}/segments/{session}~{index}");
      }
      const auto data = context_.store->GetSegmentData(parts->rig, parts->key);
      if (!data.ok()) {
        return ToGrpc(data.status(), {kSegmentType, request->name(), {}});
      }
      *response = ToProto(*data);
      return grpc::Status::OK;
    });
  }

  grpc::Status ListTables(grpc::ServerContext* call,
                          const v1::ListTablesRequest* request,
                          v1::ListTablesResponse* response) override {
    return Authorised(context_, *call, *request, [&]() -> grpc::Status {
      const auto rig = ParseRigName(request->parent());
      if (!rig) return BadName("parent", "rigs/{rig}");
      const auto tables = context_.store->GetTables(*rig);
      if (!tables.ok()) {
        return ToGrpc(tables.status(), {kRigType, request->parent(), {}});
      }
      for (const Table& table : *tables) {
        *response->add_tables() = Encode(*rig, table);
      }
      return grpc::Status::OK;
    });
  }

  grpc::Status GetTable(grpc::ServerContext* call,
                        const v1::GetTableRequest* request,
                        v1::Table* response) override {
    return Authorised(context_, *call, *request, [&]() -> grpc::Status {
      const auto parts = ParseChildName(request->name(), "tables");
      if (!parts) return BadName("name", "rigs/{rig}/tables/{group}");
      const Subject subject{kTableType, request->name(), {}};
      const auto tables = context_.store->GetTables(parts->rig);
      if (!tables.ok()) return ToGrpc(tables.status(), subject);
      const auto table =
          std::find_if(tables->begin(), tables->end(), [&](const Table& t) {
            return t.group == parts->id;
          });
      if (table == tables->end()) {
        return ToGrpc(
            absl::NotFoundError("the rig has no group of parameters '" +
                                Shortened(parts->id, 100) + "'"),
            subject);
      }
      *response = Encode(parts->rig, *table);
      return grpc::Status::OK;
    });
  }

  grpc::Status QuarantineSegments(
      grpc::ServerContext* call,
      const v1::QuarantineSegmentsRequest* request,
      v1::QuarantineSegmentsResponse* response) override {
    return Authorised(context_, *call, *request, [&]() -> grpc::Status {
      const auto rig = ParseRigName(request->parent());
      if (!rig) return BadName("parent", "rigs/{rig}");
      if (request->session().empty()) {
        return InvalidFields({{"session", "must not be empty"}});
      }
      if (!IsReason(request->reason())) {
        return InvalidFields({{"reason", std::string(kReasonRule)}});
      }
      const auto commit = context_.pipeline->QuarantineSegments(
          *rig,
          request->session(),
          request->has_index() ? std::optional(request->index()) : std::nullopt,
          CallerName(*call),
          request->reason());
      if (!commit.ok()) {
        return ToGrpc(commit.status(),
                      {kSegmentType,
                       request->parent() + "/segments/" + request->session(),
                       {}});
      }
      response->set_quarantined(commit->quarantined);
      response->set_unusable(commit->unusable);
      return grpc::Status::OK;
    });
  }

 private:
  ServiceContext context_;
  std::atomic<int> open_streams_ = 0;
};

}  // namespace

std::unique_ptr<grpc::Service> MakeSegmentService(
    const ServiceContext& context) {
  return std::make_unique<SegmentService>(context);
}

}  // namespace selfcal::server
