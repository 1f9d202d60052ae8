#pragma once

#include <absl/status/statusor.h>

#include "selfcal/v1/fleet.pb.h"
#include "server/pipeline/cohort_report.h"
#include "server/store/store.h"

namespace selfcal::server {

v1::Cohort Encode(const CohortReport& report);
// DATA_LOSS if the content cannot be read.
absl::StatusOr<v1::CohortVersion> Encode(const StoredCohort& cohort);

}  // namespace selfcal::server
