#include "server/api/read_rig_query.h"

#include "server/api/errors.h"
#include "server/encode/rig_filter.h"

namespace selfcal::server {

absl::Status ReadRigQuery(const std::string& filter,
                          const std::string& order_by,
                          RigQuery* query) {
  absl::Status status = ParseRigFilter(filter, query);
  if (!status.ok()) return About(status, {kRigType, "", "filter"});
  status = ParseRigOrder(order_by, query);
  return About(status, {kRigType, "", "order_by"});
}

}  // namespace selfcal::server
