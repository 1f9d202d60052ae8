#include "proto/resource_names.h"
#include "selfcal/v1/store_service.pb.h"
#include "server/api/errors.h"
#include "server/api/list_parent.h"
#include "server/api/methods.h"
#include "server/api/paging.h"
#include "server/api/read_rig_query.h"
#include "server/domain/clock.h"
#include "server/encode/encode.h"
#include "server/status/status_macros.h"
#include "server/store/maintenance.h"

namespace selfcal::server {
namespace {

absl::Status CheckStore(const ApiContext& context,
                        const Call&,
                        const v1::CheckStoreRequest&,
                        const Writer<v1::CheckStoreResponse>& write) {
  SELFCAL_ASSIGN_OR_RETURN(
      const CheckSummary summary,
      context.store->maintenance()->Check([&](const StoreProblem& problem) {
        v1::CheckStoreResponse response;
        response.mutable_problem()->set_place(problem.place);
        response.mutable_problem()->set_description(problem.description);
        return write(response);
      }));
  v1::CheckStoreResponse response;
  response.mutable_summary()->set_bytes(summary.bytes);
  response.mutable_summary()->set_checksums(summary.checksums);
  response.mutable_summary()->set_payloads(summary.payloads);
  response.mutable_summary()->set_problems(summary.problems);
  write(response);
  return absl::OkStatus();
}

absl::Status BackupStore(const ApiContext& context,
                         const Call&,
                         const v1::BackupStoreRequest&,
                         const Writer<v1::BackupStoreResponse>& write) {
  SELFCAL_ASSIGN_OR_RETURN(
      const BackupSummary summary,
      context.store->maintenance()->Backup([&](std::string_view bytes) {
        v1::BackupStoreResponse response;
        response.set_data(bytes.data(), bytes.size());
        return write(response);
      }));
  v1::BackupStoreResponse response;
  response.mutable_summary()->set_bytes(summary.bytes);
  response.mutable_summary()->set_sha256(summary.sha256);
  write(response);
  return absl::OkStatus();
}

absl::StatusOr<v1::RestoreStoreResponse> RestoreStore(
    const ApiContext& context,
    const Call&,
    const Reader<v1::RestoreStoreRequest>& read) {
  SELFCAL_ASSIGN_OR_RETURN(const auto restoration,
                           context.store->maintenance()->BeginRestore());
  v1::RestoreStoreRequest request;
  while (read(&request)) {
    if (context.stopping->load()) return ShuttingDown();
    if (request.part_case() == v1::RestoreStoreRequest::kSha256) {
      v1::RestoreStoreResponse response;
      SELFCAL_ASSIGN_OR_RETURN(*response.mutable_previous_database(),
                               restoration->Finish(request.sha256(), NowNs()));
      if (context.restored) context.restored();
      return response;
    }
    SELFCAL_RETURN_IF_ERROR(restoration->Append(request.data()));
  }
  return InvalidFields({{"sha256",
                         "is missing: send the checksum of the backup after "
                         "its last piece"}});
}

absl::StatusOr<v1::ListEventsResponse> ListEvents(
    const ApiContext& context,
    const Call& call,
    const v1::ListEventsRequest& request) {
  SELFCAL_ASSIGN_OR_RETURN(
      ListParent parent,
      ReadListParent(call, request.parent(), request.rig_filter()));
  if (!parent.rig.empty()) {
    const absl::Status found = context.store->GetRig(parent.rig).status();
    if (!found.ok()) {
      return About(found, {kRigType, request.parent(), "parent"});
    }
    // Whose rights are limited sees no events of an earlier rig of this name.
    SELFCAL_RETURN_IF_ERROR(ReadRigQuery(call, "", "", &parent.of));
  }
  const bool newest_first = request.order_by() == "number desc";
  if (!newest_first && !request.order_by().empty() &&
      request.order_by() != "number") {
    return InvalidFields({{"order_by", "must be 'number' or 'number desc'"}});
  }
  return FillPage<v1::ListEventsResponse>(
      request,
      request.parent(),
      [&](const Page& page) {
        return newest_first
                   ? context.store->ListNewestEvents(
                         page, parent.rig, parent.of)
                   : context.store->ListEvents(page, parent.rig, parent.of);
      },
      [](const StoredEvent& event, v1::ListEventsResponse* to) {
        *to->add_events() = Encode(event);
        return absl::OkStatus();
      });
}

}  // namespace

void AddStoreMethods(Methods* methods) {
  methods->Add(CheckStore);
  methods->Add(BackupStore);
  methods->Add(RestoreStore);
  methods->Add(ListEvents);
}

}  // namespace selfcal::server
