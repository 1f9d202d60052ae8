#pragma once

#include "selfcal/v1/fleet.pb.h"
#include "server/pipeline/cohort_report.h"

namespace selfcal::server {

v1::Cohort Encode(const CohortReport& report);

}  // namespace selfcal::server
