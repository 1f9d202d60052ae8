// A run of the solver as the command line shows it, and follows it to its end.
#pragma once

#include "client/cli/context.h"
#include "selfcal/v1/recalibration.grpc.pb.h"

namespace selfcal::client {

void PrintRun(const Context& context, const v1::Recalibration& run);

enum class ShownAsJson {
  kEnd,         // one document
  kEachUpdate,  // a line each, the end included
};

// Waits for the end of the run, through restarts of the daemon, and shows the
// result. The exit code: kFailed if there is none that may be used.
int FollowRun(Context* context,
              v1::RecalibrationService::StubInterface* stub,
              v1::Recalibration run,
              ShownAsJson shown = ShownAsJson::kEnd);

}  // namespace selfcal::client
