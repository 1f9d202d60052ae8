#include "server/api/read_rig_query.h"

#include "server/access/grants.h"
#include "server/api/errors.h"
#include "server/encode/rig_filter.h"

namespace selfcal::server {

absl::Status ReadRigQuery(const Call& call,
                          const std::string& filter,
                          const std::string& order_by,
                          RigQuery* query,
                          const std::string& filter_field) {
  const auto rights = RightsOf(call.caller, Role::kRead);
  if (rights) query->choice = RigChoice{rights->rigs, rights->labels};
  absl::Status status = ParseRigFilter(filter, query);
  if (!status.ok()) return About(status, {kRigType, "", filter_field});
  status = ParseRigOrder(order_by, query);
  return About(status, {kRigType, "", "order_by"});
}

}  // namespace selfcal::server
