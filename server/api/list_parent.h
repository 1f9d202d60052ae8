// The parent of a list: one rig, or the rigs of a filter.
#pragma once

#include <absl/status/statusor.h>

#include <string>

#include "server/api/call.h"
#include "server/store/rig_query.h"

namespace selfcal::server {

struct ListParent {
  std::string rig;  // empty: the rigs of `of`
  RigQuery of;
};

// Reads rigs/{rig}, or nothing for those that the filter selects and the caller
// may read. INVALID_ARGUMENT names the field; `filter_field` is that of the
// filter, which must be empty with a rig.
absl::StatusOr<ListParent> ReadListParent(
    const Call& call,
    const std::string& parent,
    const std::string& filter,
    const std::string& filter_field = "rig_filter");

}  // namespace selfcal::server
