#include "client/cli/cohort_versions.h"

#include <fmt/format.h>

#include "client/cli/list_options.h"
#include "selfcal/v1/fleet.grpc.pb.h"

namespace selfcal::client {

absl::Status NameCohort(const std::string& cohort,
                        v1::ListCohortsRequest* request) {
  const std::size_t sign = cohort.find('=');
  if (sign == 0 || sign == cohort.npos || sign + 1 == cohort.size()) {
    return absl::InvalidArgumentError("'" + cohort +
                                      "' is not a cohort: give LABEL=VALUE, "
                                      "e.g. model=t4");
  }
  request->set_label(cohort.substr(0, sign));
  request->set_value(cohort.substr(sign + 1));
  return absl::OkStatus();
}

grpc::Status CallForCohorts(
    const Context& context,
    const v1::ListCohortsRequest& request,
    std::size_t limit,
    const std::function<bool(const v1::CohortVersion&)>& wanted,
    v1::ListCohortsResponse* cohorts) {
  using Service = v1::FleetService::StubInterface;
  const auto stub = v1::FleetService::NewStub(context.Channel());
  return CallForItems<Service>(stub.get(),
                               &Service::ListCohorts,
                               request,
                               &v1::ListCohortsResponse::mutable_cohorts,
                               limit,
                               wanted,
                               cohorts);
}

grpc::Status ReadCohortPrior(const Context& context,
                             const std::string& cohort,
                             std::int64_t version,
                             absl::StatusOr<v1::CohortVersion>* found) {
  v1::ListCohortsRequest request;
  const absl::Status named = NameCohort(cohort, &request);
  if (!named.ok()) {
    *found = named;
    return grpc::Status::OK;
  }
  v1::ListCohortsResponse cohorts;
  const grpc::Status status = CallForCohorts(
      context,
      request,
      1,
      [&](const v1::CohortVersion& one) {
        return version == 0 || one.version() == version;
      },
      &cohorts);
  if (!status.ok()) return status;
  if (cohorts.cohorts().empty()) {
    *found = absl::NotFoundError(
        version == 0 ? "there are no statistics of the cohort " + cohort +
                           "; 'selfcal cohort list' shows those that there are"
                     : "the cohort has no such version; 'selfcal cohort list " +
                           cohort + "' shows those that it has");
    return status;
  }
  const v1::Cohort& statistics = cohorts.cohorts(0).cohort();
  if (statistics.has_prior()) {
    *found = cohorts.cohorts(0);
  } else {
    *found = absl::FailedPreconditionError(
        fmt::format("only {} devices of the cohort are calibrated, too few for "
                    "a prior",
                    statistics.calibrated()));
  }
  return status;
}

}  // namespace selfcal::client
