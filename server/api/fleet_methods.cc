#include "selfcal/v1/fleet.pb.h"
#include "server/api/errors.h"
#include "server/api/list_parent.h"
#include "server/api/methods.h"
#include "server/api/paging.h"
#include "server/api/read_rig_query.h"
#include "server/encode/encode_cohort.h"
#include "server/encode/encode_estimate.h"
#include "server/status/status_macros.h"

namespace selfcal::server {
namespace {

constexpr int kDefaultRigs = 500;
constexpr int kMostRigs = 2000;

absl::StatusOr<v1::Cohort> DescribeCohort(
    const ApiContext& context,
    const Call& call,
    const v1::DescribeCohortRequest& request) {
  if (request.max_rigs() < 0 || request.max_rigs() > kMostRigs) {
    return InvalidFields({{"max_rigs", "must be from 0 to 2000"}});
  }
  RigQuery query;
  query.order = RigQuery::Order::kLastSeen;
  query.descending = true;
  SELFCAL_RETURN_IF_ERROR(ReadRigQuery(call, request.filter(), "", &query));
  SELFCAL_ASSIGN_OR_RETURN(
      const CohortReport report,
      DescribeCohort(
          context.store,
          query,
          request.max_rigs() == 0 ? kDefaultRigs : request.max_rigs(),
          [&] { return call.cancelled() || context.stopping->load(); }));
  return Encode(report);
}

absl::StatusOr<v1::ListCohortsResponse> ListCohorts(
    const ApiContext& context,
    const Call&,
    const v1::ListCohortsRequest& request) {
  if (request.label().empty() != request.value().empty()) {
    return InvalidFields({{request.label().empty() ? "label" : "value",
                           "is empty; give both, or neither for the newest "
                           "version of every cohort"}});
  }
  return FillPage<v1::ListCohortsResponse>(
      request,
      "",
      [&](const Page& page) {
        return context.store->ListCohorts(
            request.label(), request.value(), page);
      },
      [](const StoredCohort& cohort,
         v1::ListCohortsResponse* to) -> absl::Status {
        SELFCAL_ASSIGN_OR_RETURN(*to->add_cohorts(), Encode(cohort));
        return absl::OkStatus();
      });
}

absl::StatusOr<v1::ListEstimatesResponse> ListEstimates(
    const ApiContext& context,
    const Call& call,
    const v1::ListEstimatesRequest& request) {
  SELFCAL_ASSIGN_OR_RETURN(
      const ListParent parent,
      ReadListParent(call, request.parent(), request.filter(), "filter"));
  EstimateQuery query{parent.of, request.component(), request.only_active()};
  if (!parent.rig.empty()) query.rigs.name = parent.rig;
  return FillPage<v1::ListEstimatesResponse>(
      request,
      request.parent(),
      [&](const Page& page) {
        return context.store->ListEstimates(query, page);
      },
      [](const StoredEstimate& estimate, v1::ListEstimatesResponse* to) {
        *to->add_estimates() = Encode(estimate);
        return absl::OkStatus();
      });
}

}  // namespace

void AddFleetMethods(Methods* methods) {
  methods->Add(DescribeCohort);
  methods->Add(ListCohorts);
  methods->Add(ListEstimates);
}

}  // namespace selfcal::server
