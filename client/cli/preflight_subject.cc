#include "client/cli/preflight_subject.h"

#include <fmt/format.h>

#include "client/cli/device_data.h"
#include "proto/convert.h"

namespace selfcal::client {

grpc::Status ReadPreflightSubject(Context* context,
                                  const std::string& device,
                                  int newest,
                                  PreflightSubject* subject) {
  v1::Rig message;
  grpc::Status status = ReadDevice(context, device, &message);
  if (!status.ok()) return status;
  if (const auto violations = FromProto(message, "", &subject->rig);
      !violations.empty()) {
    return {grpc::StatusCode::DATA_LOSS,
            "the daemon's rig is not valid: " + violations[0].message};
  }
  status = ReadNewestSegments(context, device, newest, &subject->segments);
  if (!status.ok()) return status;
  if (subject->segments.empty()) {
    return {grpc::StatusCode::FAILED_PRECONDITION,
            "the daemon has no segment data of " + device +
                ": send segments from the device, then try again"};
  }
  const std::int64_t version = subject->segments[0].calibration_version;
  const auto theta = ReadVersion(context, subject->rig, version);
  if (!theta) {
    return {grpc::StatusCode::NOT_FOUND,
            fmt::format("version {}, with which the segments were recorded, "
                        "cannot be read",
                        version)};
  }
  subject->theta = *theta;
  return status;
}

}  // namespace selfcal::client
