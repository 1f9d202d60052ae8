// The solver's report in databases from before it was stored as the message of
// the contract.
#pragma once

#include <string>

#include "selfcal/store/records.pb.h"
#include "selfcal/v1/calibration_service.pb.h"

namespace selfcal::server {

// The report of a calibration of `rig`.
v1::SolverReport Upgrade(const store::EarlierReport& earlier,
                         const std::string& rig);

}  // namespace selfcal::server
