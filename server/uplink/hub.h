// The hub, as a device sees it.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <memory>

#include "selfcal/v1/uplink.pb.h"
#include "server/uplink/uplink_options.h"

namespace selfcal::server {

class Hub {
 public:
  virtual ~Hub() = default;

  // UplinkService.Report. UNAVAILABLE if the hub cannot be reached, or a TLS
  // file cannot be read; CANCELLED after Cancel.
  virtual absl::StatusOr<v1::ReportResponse> Report(
      const v1::ReportRequest& request) = 0;
  // Ends a report that is under way, and all later ones. Any thread may call.
  virtual void Cancel() = 0;
};

// The hub over gRPC. It is not reached before the first report, and the TLS
// files are read again after each failure.
std::unique_ptr<Hub> MakeGrpcHub(const UplinkOptions& options);
// INVALID_ARGUMENT for settings that cannot work.
absl::Status CheckUplink(const UplinkOptions& options);

}  // namespace selfcal::server
