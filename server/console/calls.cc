#include <charconv>
#include <nlohmann/json.hpp>

#include "proto/resource_names.h"
#include "selfcal/v1/rig.pb.h"
#include "selfcal/v1/store_service.pb.h"
#include "server/console/asked.h"
#include "server/console/overview.h"
#include "server/encode/encode.h"
#include "server/store/status_macros.h"

namespace selfcal::server {
namespace {

absl::StatusOr<RigQuery> QueryOf(const Call& call) {
  RigQuery query;
  query.text = call.Query("filter");
  const std::string order = call.Query("order_by");
  query.descending = order.ends_with(" desc");
  const std::string field = order.substr(0, order.find(' '));
  if (field == "last_seen") {
    query.order = RigQuery::Order::kLastSeen;
  } else if (!field.empty() && field != "name") {
    return absl::InvalidArgumentError(
        "order_by must be name or last_seen, with ' desc' for descending "
        "order");
  }
  return query;
}

nlohmann::json GrantsOf(const Caller& caller) {
  nlohmann::json grants = nlohmann::json::array();
  for (const Grant& grant : caller.grants) {
    grants.push_back({{"role", std::string(RoleName(grant.role))},
                      {"rig", grant.rig.empty() ? "" : RigName(grant.rig)}});
  }
  return grants;
}

}  // namespace

absl::StatusOr<int> CountOf(const Call& call,
                            const std::string& name,
                            int without,
                            std::string_view rule) {
  const std::string text = call.Query(name);
  if (text.empty()) return without;
  int count = 0;
  const char* end = text.data() + text.size();
  const auto [rest, error] = std::from_chars(text.data(), end, count);
  if (error == std::errc() && rest == end && count >= 1) return count;
  return absl::InvalidArgumentError(std::string(rule));
}

absl::StatusOr<Page> PageOf(const Call& call) {
  constexpr int kDefault = 50;
  SELFCAL_ASSIGN_OR_RETURN(
      const int size,
      CountOf(
          call,
          "page_size",
          kDefault,
          "page_size must be a number from 1 to 1000; without it a page has "
          "50"));
  return Page{size, call.Query("page_token")};
}

absl::StatusOr<std::string> RigOf(const Call& call) {
  const auto rig = ParseRigName(RigName(call.parts.at(0)));
  if (rig) return *rig;
  return absl::InvalidArgumentError(
      "a rig's name must have 1 to 63 characters from a-z, 0-9, '-' and '_'");
}

// Returns the rights of the caller; the pages hide what it may not do.
Answer GetSession(const Call& call) {
  const nlohmann::json body = {
      {"caller", call.request.caller.name},
      {"grants", GrantsOf(call.request.caller)},
      {"programVersion", call.context.program_version}};
  HttpResponse response;
  response.body = body.dump();
  return response;
}

Answer ListRigs(const Call& call) {
  SELFCAL_RETURN_IF_ERROR(
      Authorise(call.request.caller, v1::ListRigsRequest()));
  SELFCAL_ASSIGN_OR_RETURN(const RigQuery query, QueryOf(call));
  SELFCAL_ASSIGN_OR_RETURN(const Page page, PageOf(call));
  return PageAnswer<console::ListRigOverviewsResponse>(
      call.context.store->ListRigSummaries(query, page),
      [](const RigSummary& rig, auto* response) {
        *response->add_rigs() = Encode(rig);
        return absl::OkStatus();
      });
}

Answer GetRig(const Call& call) {
  v1::GetRigRequest request;
  request.set_name(RigName(call.parts.at(0)));
  SELFCAL_RETURN_IF_ERROR(Authorise(call.request.caller, request));
  SELFCAL_ASSIGN_OR_RETURN(const std::string rig, RigOf(call));
  SELFCAL_ASSIGN_OR_RETURN(const StoredRig stored,
                           call.context.store->GetRig(rig));
  return JsonResponse(Encode(stored));
}

// Lists events newest first, unlike over gRPC.
Answer ListEvents(const Call& call) {
  v1::ListEventsRequest request;
  std::string rig;
  if (!call.parts.empty()) request.set_parent(RigName(call.parts[0]));
  SELFCAL_RETURN_IF_ERROR(Authorise(call.request.caller, request));
  if (!call.parts.empty()) {
    SELFCAL_ASSIGN_OR_RETURN(rig, RigOf(call));
    SELFCAL_RETURN_IF_ERROR(call.context.store->GetRig(rig).status());
  }
  SELFCAL_ASSIGN_OR_RETURN(const Page page, PageOf(call));
  return PageAnswer<v1::ListEventsResponse>(
      call.context.store->ListNewestEvents(page, rig),
      [](const StoredEvent& event, auto* response) {
        *response->add_events() = Encode(event);
        return absl::OkStatus();
      });
}

}  // namespace selfcal::server
