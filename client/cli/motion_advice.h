// The coach's advice, for the commands that show it.
#pragma once

#include <grpcpp/support/status.h>

#include <string>

#include "client/cli/context.h"
#include "selfcal/v1/calibration_service.pb.h"

namespace selfcal::client {

// Asks for the `top` best motions.
grpc::Status AskForAdvice(Context* context,
                          const std::string& rig,
                          int top,
                          v1::AdviseMotionResponse* response);

std::string GainText(double gain_nats);

// Lines: what is hardly known, what to record for how long until it is and
// until there are enough segments, and what no motion teaches; or that nothing
// is missing, with the motion that would add most.
std::string MissingText(const v1::AdviseMotionResponse& response);

}  // namespace selfcal::client
