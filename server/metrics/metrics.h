// Metrics for Prometheus: GET /metrics on an HTTP port of the loopback
// interface.
//
// The number of series is bounded. Two labels come from clients: the rig,
// limited to the `rigs` rigs that sent last, and the group of parameters, where
// unusual names are replaced by "other".
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <filesystem>
#include <memory>
#include <string>

#include "server/access/tls_reload.h"
#include "server/pipeline/observer.h"
#include "server/store/store.h"

namespace selfcal::server {

struct MetricsOptions {
  std::string address;  // host:port; port 0 selects a free one
  int rigs = 16;        // number of rigs with their own series
  std::string program_version;
  // The file whose size and free space are reported; empty: none.
  std::filesystem::path database;
};

class Metrics {
 public:
  virtual ~Metrics() = default;

  // The observer for the pipeline; lives as long as the metrics.
  virtual PipelineObserver* observer() = 0;
  // The URL, with the actual port.
  virtual const std::string& url() const = 0;

  // Adds the expiry of these files, and whether those on disk are in force.
  // Null: there are none.
  virtual void AddTls(std::shared_ptr<const TlsReload> tls) = 0;
};

// INVALID_ARGUMENT unless the address is a port of the loopback interface,
// because there is no authentication.
absl::Status CheckMetricsAddress(const std::string& address);

// Starts to serve metrics; `store` must outlive it. Errors are those of
// CheckMetricsAddress; UNAVAILABLE if the port cannot be opened.
absl::StatusOr<std::unique_ptr<Metrics>> MakeMetrics(
    Store* store, const MetricsOptions& options);

}  // namespace selfcal::server
