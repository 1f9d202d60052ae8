#include "server/metrics/metrics.h"

#include <prometheus/collectable.h>
#include <prometheus/gauge.h>
#include <prometheus/registry.h>
#include <prometheus/text_serializer.h>

#include <mutex>
#include <utility>
#include <vector>

#include "server/http/address.h"
#include "server/http/error_response.h"
#include "server/http/http_server.h"
#include "server/metrics/event_metrics.h"
#include "server/metrics/recent_rigs.h"
#include "server/metrics/state_metrics.h"
#include "server/metrics/tls_metrics.h"
#include "server/status/status_macros.h"

namespace selfcal::server {
namespace {

constexpr char kPath[] = "/metrics";

class PrometheusMetrics final : public Metrics {
 public:
  PrometheusMetrics(Store* store, const MetricsOptions& options)
      : rigs_(options.rigs),
        registry_(std::make_shared<prometheus::Registry>()),
        events_(store, &rigs_, registry_.get()),
        sources_{
            registry_,
            std::make_shared<StateMetrics>(store, &rigs_, options.database)} {
    prometheus::BuildGauge()
        .Name("selfcal_build_info")
        .Help("Constant 1, with the version of the program as label.")
        .Register(*registry_)
        .Add({{"version", options.program_version}})
        .Set(1);
  }

  absl::Status Start(const HttpOptions& options) {
    SELFCAL_ASSIGN_OR_RETURN(
        server_, MakeHttpServer(options, [this](const HttpRequest& request) {
          return Answer(request);
        }));
    url_ = server_->url() + kPath;
    return absl::OkStatus();
  }

  PipelineObserver* observer() override { return &events_; }
  const std::string& url() const override { return url_; }

  void AddTls(std::shared_ptr<const TlsReload> tls) override {
    if (tls == nullptr) return;
    const std::lock_guard lock(mutex_);
    sources_.push_back(std::make_shared<TlsMetrics>(std::move(tls)));
  }

 private:
  HttpResponse Answer(const HttpRequest& request) {
    if (request.method != "GET" && request.method != "HEAD") {
      return ErrorResponse(
          absl::UnimplementedError("metrics can only be read, with GET"));
    }
    if (request.path != kPath) {
      return ErrorResponse(
          absl::NotFoundError(std::string("the metrics are at ") + kPath));
    }
    HttpResponse response;
    response.type = "text/plain; version=0.0.4; charset=utf-8";
    response.body = prometheus::TextSerializer().Serialize(Collect());
    return response;
  }

  std::vector<prometheus::MetricFamily> Collect() {
    const std::lock_guard lock(mutex_);
    std::vector<prometheus::MetricFamily> families;
    for (const auto& source : sources_) {
      for (prometheus::MetricFamily& family : source->Collect()) {
        families.push_back(std::move(family));
      }
    }
    return families;
  }

  RecentRigs rigs_;
  std::shared_ptr<prometheus::Registry> registry_;
  EventMetrics events_;
  std::mutex mutex_;  // guards the sources, and collects one scrape at a time
  std::vector<std::shared_ptr<prometheus::Collectable>> sources_;
  std::string url_;
  std::unique_ptr<HttpServer> server_;  // last: its threads use the others
};

HttpOptions HttpOf(const std::string& address) {
  HttpOptions options;
  options.name = "metrics";
  options.address = address;
  return options;
}

}  // namespace

absl::Status CheckMetricsAddress(const std::string& address) {
  const auto parsed = ParseSocketAddress(address);
  if (parsed.ok() && parsed->loopback) return absl::OkStatus();
  return absl::InvalidArgumentError(
      "metrics: '" + address +
      "' is not a loopback address such as 127.0.0.1:9464; there is no "
      "authentication, so use a proxy for access from other machines");
}

absl::StatusOr<std::unique_ptr<Metrics>> MakeMetrics(
    Store* store, const MetricsOptions& options) {
  SELFCAL_RETURN_IF_ERROR(CheckMetricsAddress(options.address));
  auto metrics = std::make_unique<PrometheusMetrics>(store, options);
  SELFCAL_RETURN_IF_ERROR(metrics->Start(HttpOf(options.address)));
  return metrics;
}

}  // namespace selfcal::server
