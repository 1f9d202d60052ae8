// Shows a run on the command line and follows it to its end.
#pragma once

#include <string>

#include "client/cli/context.h"
#include "selfcal/v1/recalibration.grpc.pb.h"

namespace selfcal::client {

bool HasEnded(const v1::Recalibration& run);

// Reads the newest run of a rig; it has no name if there is none.
grpc::Status ReadNewestRun(v1::RecalibrationService::StubInterface* stub,
                           const std::string& rig,
                           v1::Recalibration* run);

void PrintRun(const Context& context, const v1::Recalibration& run);

enum class ShownAsJson {
  kEnd,         // one document at the end
  kEachUpdate,  // a line for each update, also for the end
};

// Waits for the end of the run, also through restarts of the daemon, and shows
// the result. Returns the exit code: kFailed if there is no usable result.
int FollowRun(Context* context,
              v1::RecalibrationService::StubInterface* stub,
              v1::Recalibration run,
              ShownAsJson shown = ShownAsJson::kEnd);

}  // namespace selfcal::client
