// Conversion of the coach's advice to a message of the contract.
#pragma once

#include "selfcal/v1/calibration_service.pb.h"
#include "server/pipeline/coaching.h"

namespace selfcal::server {

// Encodes the best `max_advice` motions.
v1::AdviseMotionResponse Encode(const RigCoaching& coaching, int max_advice);

}  // namespace selfcal::server
