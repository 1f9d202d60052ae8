#include "selfcal/v1/fleet.pb.h"
#include "server/api/errors.h"
#include "server/api/methods.h"
#include "server/api/read_rig_query.h"
#include "server/encode/encode_cohort.h"
#include "server/status/status_macros.h"

namespace selfcal::server {
namespace {

constexpr int kDefaultRigs = 500;
constexpr int kMostRigs = 2000;

absl::StatusOr<v1::Cohort> DescribeCohort(
    const ApiContext& context,
    const Call&,
    const v1::DescribeCohortRequest& request) {
  if (request.max_rigs() < 0 || request.max_rigs() > kMostRigs) {
    return InvalidFields({{"max_rigs", "must be from 0 to 2000"}});
  }
  RigQuery query;
  query.order = RigQuery::Order::kLastSeen;
  query.descending = true;
  SELFCAL_RETURN_IF_ERROR(ReadRigQuery(request.filter(), "", &query));
  SELFCAL_ASSIGN_OR_RETURN(
      const CohortReport report,
      DescribeCohort(
          context.store,
          query,
          request.max_rigs() == 0 ? kDefaultRigs : request.max_rigs()));
  return Encode(report);
}

}  // namespace

void AddFleetMethods(Methods* methods) { methods->Add(DescribeCohort); }

}  // namespace selfcal::server
