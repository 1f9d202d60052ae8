// What Prometheus reads: GET /metrics on an HTTP port of the loopback.
//
// The number of series is bounded: labels that come from clients are the rig,
// for `rigs` rigs at most (those that sent last), and the group of parameters,
// where others than the usual ones are "other".
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <filesystem>
#include <memory>
#include <string>

#include "server/pipeline/observer.h"
#include "server/store/store.h"

namespace selfcal::server {

struct MetricsOptions {
  std::string address;  // host:port; port 0 takes a free one
  int rigs = 16;        // with series of their own
  std::string program_version;
  std::filesystem::path database;  // whose bytes and free space are told
};

class Metrics {
 public:
  virtual ~Metrics() = default;

  // For the pipeline; lives as long as the metrics.
  virtual PipelineObserver* observer() = 0;
  // The URL with the port that was taken.
  virtual const std::string& url() const = 0;
};

// INVALID_ARGUMENT for what is no port of the loopback: there is no
// authentication.
absl::Status CheckMetricsAddress(const std::string& address);

// Starts to answer; `store` must outlive it. Errors of CheckMetricsAddress;
// UNAVAILABLE if the port cannot be opened.
absl::StatusOr<std::unique_ptr<Metrics>> MakeMetrics(
    Store* store, const MetricsOptions& options);

}  // namespace selfcal::server
