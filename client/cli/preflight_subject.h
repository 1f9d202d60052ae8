// The subject of a pre-flight check: a rig, a calibration and segments.
#pragma once

#include <grpcpp/support/status.h>

#include <string>
#include <vector>

#include "client/cli/context.h"
#include "core/model/calibration.h"
#include "core/model/rig.h"
#include "core/model/segment.h"

namespace selfcal::client {

struct PreflightSubject {
  Rig rig;
  Calibration theta;
  std::vector<MotionSegment> segments;
};

// Reads the newest segments of a device whose data is kept, with the version
// that they were recorded with. FAILED_PRECONDITION if there are none.
grpc::Status ReadPreflightSubject(Context* context,
                                  const std::string& device,
                                  int newest,
                                  PreflightSubject* subject);

}  // namespace selfcal::client
