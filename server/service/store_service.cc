#include "proto/resource_names.h"
#include "selfcal/v1/store_service.grpc.pb.h"
#include "server/encode/encode.h"
#include "server/service/caller.h"
#include "server/service/errors.h"
#include "server/service/paging.h"
#include "server/service/services.h"
#include "server/store/maintenance.h"

namespace selfcal::server {
namespace {

constexpr char kRigType[] = "selfcal.v1.Rig";

class StoreService final : public v1::StoreService::Service {
 public:
  explicit StoreService(const ServiceContext& context) : context_(context) {}

  grpc::Status CheckStore(
      grpc::ServerContext* call,
      const v1::CheckStoreRequest* request,
      grpc::ServerWriter<v1::CheckStoreResponse>* writer) override {
    return Maintained(
        *call, *request, [&](StoreMaintenance* maintenance) -> grpc::Status {
          const auto summary =
              maintenance->Check([&](const StoreProblem& problem) {
                v1::CheckStoreResponse response;
                response.mutable_problem()->set_place(problem.place);
                response.mutable_problem()->set_description(
                    problem.description);
                return !context_.stopping->load() && writer->Write(response);
              });
          if (!summary.ok()) return Ended(summary.status());
          v1::CheckStoreResponse response;
          response.mutable_summary()->set_bytes(summary->bytes);
          response.mutable_summary()->set_checksums(summary->checksums);
          response.mutable_summary()->set_payloads(summary->payloads);
          response.mutable_summary()->set_problems(summary->problems);
          writer->Write(response);
          return grpc::Status::OK;
        });
  }

  grpc::Status BackupStore(
      grpc::ServerContext* call,
      const v1::BackupStoreRequest* request,
      grpc::ServerWriter<v1::BackupStoreResponse>* writer) override {
    return Maintained(
        *call, *request, [&](StoreMaintenance* maintenance) -> grpc::Status {
          const auto summary = maintenance->Backup([&](std::string_view bytes) {
            v1::BackupStoreResponse response;
            response.set_data(bytes.data(), bytes.size());
            return !context_.stopping->load() && writer->Write(response);
          });
          if (!summary.ok()) return Ended(summary.status());
          v1::BackupStoreResponse response;
          response.mutable_summary()->set_bytes(summary->bytes);
          response.mutable_summary()->set_sha256(summary->sha256);
          writer->Write(response);
          return grpc::Status::OK;
        });
  }

  grpc::Status RestoreStore(grpc::ServerContext* call,
                            grpc::ServerReader<v1::RestoreStoreRequest>* reader,
                            v1::RestoreStoreResponse* response) override {
    return Maintained(
        *call,
        v1::RestoreStoreRequest(),
        [&](StoreMaintenance* maintenance) -> grpc::Status {
          auto restoration = maintenance->BeginRestore();
          if (!restoration.ok()) return Ended(restoration.status());
          v1::RestoreStoreRequest request;
          while (reader->Read(&request)) {
            if (context_.stopping->load()) return ShuttingDown();
            if (request.part_case() == v1::RestoreStoreRequest::kSha256) {
              const auto previous = (*restoration)->Finish(request.sha256());
              if (!previous.ok()) return Ended(previous.status());
              response->set_previous_database(*previous);
              if (context_.restored) context_.restored();
              return grpc::Status::OK;
            }
            const absl::Status status = (*restoration)->Append(request.data());
            if (!status.ok()) return Ended(status);
          }
          return InvalidFields({{"sha256",
                                 "is missing: send the checksum of the backup "
                                 "after its last piece"}});
        });
  }

  grpc::Status ListEvents(grpc::ServerContext* call,
                          const v1::ListEventsRequest* request,
                          v1::ListEventsResponse* response) override {
    return Authorised(context_, *call, *request, [&]() -> grpc::Status {
      std::string rig;
      if (!request->parent().empty()) {
        const auto parsed = ParseRigName(request->parent());
        if (!parsed) return BadName("parent", "rigs/{rig}");
        const absl::Status found = context_.store->GetRig(*parsed).status();
        if (!found.ok()) {
          return ToGrpc(found, {kRigType, request->parent(), "parent"});
        }
        rig = *parsed;
      }
      return FillPage(
          *request,
          request->parent(),
          [&](const Page& page) {
            return context_.store->ListEvents(page, rig);
          },
          [](const StoredEvent& event, v1::ListEventsResponse* to) {
            *to->add_events() = Encode(event);
            return grpc::Status::OK;
          },
          response);
    });
  }

 private:
  template <typename Handler>
  grpc::Status Maintained(const grpc::ServerContext& call,
                          const google::protobuf::Message& request,
                          const Handler& handler) {
    return Authorised(context_, call, request, [&]() -> grpc::Status {
      StoreMaintenance* maintenance = context_.store->maintenance();
      if (maintenance == nullptr) {
        return {grpc::StatusCode::UNIMPLEMENTED,
                "this store is administered with the tools of its database"};
      }
      return handler(maintenance);
    });
  }

  grpc::Status Ended(const absl::Status& status) const {
    return context_.stopping->load() ? ShuttingDown() : ToGrpc(status, {});
  }

  ServiceContext context_;
};

}  // namespace

std::unique_ptr<grpc::Service> MakeStoreService(const ServiceContext& context) {
  return std::make_unique<StoreService>(context);
}

}  // namespace selfcal::server
