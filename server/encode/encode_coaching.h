// What the coach says, as the message of the contract.
#pragma once

#include "selfcal/v1/calibration_service.pb.h"
#include "server/pipeline/coaching.h"

namespace selfcal::server {

// The best `max_advice` motions.
v1::AdviseMotionResponse Encode(const RigCoaching& coaching, int max_advice);

}  // namespace selfcal::server
