#include "server/metrics/metrics.h"

#include <CivetServer.h>
#include <prometheus/exposer.h>
#include <prometheus/gauge.h>
#include <prometheus/registry.h>

#include <charconv>
#include <exception>
#include <string_view>
#include <utility>

#include "server/access/loopback_host.h"
#include "server/metrics/event_metrics.h"
#include "server/metrics/recent_rigs.h"
#include "server/metrics/state_metrics.h"
#include "server/metrics/tls_metrics.h"
#include "server/status/status_macros.h"

namespace selfcal::server {
namespace {

constexpr int kMaxPort = 65535;
constexpr std::size_t kThreads = 2;

// Returns the host of host:port; empty if there is no port.
std::string_view HostOf(std::string_view address) {
  const std::size_t colon = address.rfind(':');
  if (colon == address.npos) return {};
  int port = -1;
  const char* end = address.data() + address.size();
  const auto [rest, error] =
      std::from_chars(address.data() + colon + 1, end, port);
  const bool valid =
      error == std::errc() && rest == end && port >= 0 && port <= kMaxPort;
  return valid ? address.substr(0, colon) : std::string_view();
}

// Refuses requests under a name that is not of the loopback interface.
int BeginRequest(mg_connection* connection) {
  const char* host = mg_get_header(connection, "Host");
  if (host != nullptr && IsLoopbackHost(host)) return 0;
  constexpr int kForbidden = 403;
  mg_send_http_error(connection,
                     kForbidden,
                     "%s",
                     "the metrics can only be read as 127.0.0.1, localhost or "
                     "[::1]; a proxy has to set the header Host");
  return 1;
}

const CivetCallbacks& Callbacks() {
  static const CivetCallbacks callbacks = [] {
    CivetCallbacks result;
    result.begin_request = BeginRequest;
    return result;
  }();
  return callbacks;
}

class PrometheusMetrics final : public Metrics {
 public:
  PrometheusMetrics(Store* store, const MetricsOptions& options)
      : rigs_(options.rigs),
        registry_(std::make_shared<prometheus::Registry>()),
        events_(store, &rigs_, registry_.get()),
        state_(std::make_shared<StateMetrics>(store, &rigs_, options.database)),
        exposer_(options.address, kThreads, &Callbacks()) {
    prometheus::BuildGauge()
        .Name("selfcal_build_info")
        .Help("Constant 1, with the version of the program as label.")
        .Register(*registry_)
        .Add({{"version", options.program_version}})
        .Set(1);
    exposer_.RegisterCollectable(registry_);
    exposer_.RegisterCollectable(state_);
    url_ = "http://" + std::string(HostOf(options.address)) + ":" +
           std::to_string(exposer_.GetListeningPorts().at(0)) + "/metrics";
  }

  PipelineObserver* observer() override { return &events_; }
  const std::string& url() const override { return url_; }

  void AddTls(std::shared_ptr<const TlsReload> tls) override {
    if (tls == nullptr) return;
    tls_ = std::make_shared<TlsMetrics>(std::move(tls));
    exposer_.RegisterCollectable(tls_);
  }

 private:
  RecentRigs rigs_;
  std::shared_ptr<prometheus::Registry> registry_;
  EventMetrics events_;
  std::shared_ptr<StateMetrics> state_;
  std::shared_ptr<TlsMetrics> tls_;
  prometheus::Exposer exposer_;  // last: its threads use the others
  std::string url_;
};

}  // namespace

absl::Status CheckMetricsAddress(const std::string& address) {
  const std::string_view host = HostOf(address);
  if (host == "127.0.0.1" || host == "[::1]") {
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(
      "metrics: '" + address +
      "' is not a loopback address such as 127.0.0.1:9464; there is no "
      "authentication, so use a proxy for access from other machines");
}

absl::StatusOr<std::unique_ptr<Metrics>> MakeMetrics(
    Store* store, const MetricsOptions& options) {
  SELFCAL_RETURN_IF_ERROR(CheckMetricsAddress(options.address));
  try {
    return std::make_unique<PrometheusMetrics>(store, options);
  } catch (const std::exception& error) {
    return absl::UnavailableError("cannot open " + options.address +
                                  " for metrics; check that it is free (" +
                                  error.what() + ")");
  }
}

}  // namespace selfcal::server
