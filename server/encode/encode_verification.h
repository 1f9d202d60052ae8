// Conversion of verifications to messages of the contract.
#pragma once

#include <string>

#include "selfcal/v1/calibration_service.pb.h"
#include "server/pipeline/verification.h"

namespace selfcal::server {

v1::VerifyRigResponse Encode(const std::string& rig,
                             const VerificationStep& step);
// Encodes the response with the summary.
v1::VerifyRigResponse Encode(const Verification& verification);

}  // namespace selfcal::server
