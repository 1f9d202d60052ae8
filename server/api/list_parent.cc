#include "server/api/list_parent.h"

#include "proto/resource_names.h"
#include "server/api/errors.h"
#include "server/api/read_rig_query.h"
#include "server/status/status_macros.h"

namespace selfcal::server {

absl::StatusOr<ListParent> ReadListParent(const Call& call,
                                          const std::string& parent,
                                          const std::string& filter,
                                          const std::string& filter_field) {
  ListParent list;
  if (parent.empty()) {
    SELFCAL_RETURN_IF_ERROR(
        ReadRigQuery(call, filter, "", &list.of, filter_field));
    return list;
  }
  const auto rig = ParseRigName(parent);
  if (!rig) return BadName("parent", "rigs/{rig}");
  if (!filter.empty()) {
    return InvalidFields({{filter_field, "has no effect with a parent"}});
  }
  list.rig = *rig;
  return list;
}

}  // namespace selfcal::server
