// What the daemon holds of a device, as values of core/model: for checks that
// run on this side.
#pragma once

#include <grpcpp/support/status.h>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "client/cli/context.h"
#include "core/model/calibration.h"
#include "core/model/rig.h"
#include "core/model/segment.h"
#include "selfcal/v1/rig.pb.h"

namespace selfcal::client {

grpc::Status ReadDevice(Context* context,
                        const std::string& rig,
                        v1::Rig* found);

// The parameters of a version; nothing where the daemon has none.
std::optional<Calibration> ReadVersion(Context* context,
                                       const Rig& rig,
                                       std::int64_t version);

// The newest `count` segments whose data is kept and that were recorded with
// the same version as the newest of all, in the order of their arrival. What is
// dropped meanwhile is left out.
grpc::Status ReadNewestSegments(Context* context,
                                const std::string& rig,
                                int count,
                                std::vector<MotionSegment>* segments);

}  // namespace selfcal::client
