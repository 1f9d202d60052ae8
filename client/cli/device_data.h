// Reads the data of a device from the daemon as values of core/model, for
// checks that run in the client.
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
#include "selfcal/v1/calibration_service.pb.h"
#include "selfcal/v1/rig.pb.h"
#include "selfcal/v1/segment.pb.h"

namespace selfcal::client {

grpc::Status ReadDevice(Context* context,
                        const std::string& rig,
                        v1::Rig* found);

// A version of a device, as messages and as values.
struct DeviceVersion {
  v1::Rig rig_message;
  v1::Calibration message;
  Rig rig;
  Calibration theta;
};

// Reads a rig and a version of it, a number or "active", at a temperature
// [deg C] if one is given. DATA_LOSS if the daemon's answer is not valid.
grpc::Status ReadDeviceVersion(Context* context,
                               const std::string& rig,
                               const std::string& version,
                               DeviceVersion* found,
                               std::optional<double> temperature_c = {});

// Reads the newest segment that meets the filter, without its data; it has no
// name if there is none.
grpc::Status ReadNewestSegment(Context* context,
                               const std::string& rig,
                               const std::string& filter,
                               v1::Segment* segment);

// Returns the parameters of a version; nullopt if the daemon does not have it.
std::optional<Calibration> ReadVersion(Context* context,
                                       const Rig& rig,
                                       std::int64_t version);

// Reads the newest `count` segments whose data is kept and that were recorded
// with the same version as the newest segment, in the order of their arrival.
// Segments whose data is dropped in the meantime are excluded.
grpc::Status ReadNewestSegments(Context* context,
                                const std::string& rig,
                                int count,
                                std::vector<MotionSegment>* segments);

}  // namespace selfcal::client
