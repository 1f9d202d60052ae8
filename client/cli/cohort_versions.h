// Reading the statistics of cohorts that a hub has computed.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <grpcpp/support/status.h>

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>

#include "client/cli/context.h"
#include "selfcal/v1/fleet.pb.h"

namespace selfcal::client {

// Puts a cohort, LABEL=VALUE, into the request.
absl::Status NameCohort(const std::string& cohort,
                        v1::ListCohortsRequest* request);

// Lists the wanted versions, or all, newest first; `limit` 0: without a limit.
grpc::Status CallForCohorts(
    const Context& context,
    const v1::ListCohortsRequest& request,
    std::size_t limit,
    const std::function<bool(const v1::CohortVersion&)>& wanted,
    v1::ListCohortsResponse* cohorts);

// Reads a version of a cohort, LABEL=VALUE, that has a prior; 0: the newest
// version. If there is none, the status in `found` says why. The returned
// status is that of the call.
grpc::Status ReadCohortPrior(const Context& context,
                             const std::string& cohort,
                             std::int64_t version,
                             absl::StatusOr<v1::CohortVersion>* found);

}  // namespace selfcal::client
