// Helpers that the calls under /api/v1 share: the resource of a request, and a
// page as a response. Internal to server/console.
#pragma once

#include <string>

#include "proto/resource_names.h"
#include "server/console/call.h"
#include "server/console/json.h"
#include "server/store/status_macros.h"

namespace selfcal::server {

// Returns the rig of the address, if the caller may make this request about it.
template <typename Request>
absl::StatusOr<std::string> ParentOf(const Call& call) {
  Request request;
  request.set_parent(RigName(call.parts.at(0)));
  SELFCAL_RETURN_IF_ERROR(Authorise(call.request.caller, request));
  return RigOf(call);
}

// Returns the segment of the address, if the caller may make this request about
// it.
template <typename Request>
absl::StatusOr<SegmentNameParts> SegmentOf(const Call& call) {
  Request request;
  request.set_name(RigName(call.parts.at(0)) + "/segments/" + call.parts.at(1));
  SELFCAL_RETURN_IF_ERROR(Authorise(call.request.caller, request));
  const auto parts = ParseSegmentName(request.name());
  if (parts) return *parts;
  return absl::InvalidArgumentError(
      "a segment's name is rigs/{rig}/segments/{session}~{index}; in an "
      "address, a '%' of the session is written as %25");
}

// Responds with a page. `add` takes an item and the response; it returns an
// absl::Status.
template <typename Response, typename Item, typename Add>
Answer PageAnswer(const absl::StatusOr<Listed<Item>>& listed, const Add& add) {
  if (!listed.ok()) return listed.status();
  Response response;
  for (const Item& item : listed->items) {
    SELFCAL_RETURN_IF_ERROR(add(item, &response));
  }
  response.set_next_page_token(listed->next_token);
  return JsonResponse(response);
}

}  // namespace selfcal::server
