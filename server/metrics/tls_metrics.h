// Metrics of the TLS files in force.
#pragma once

#include <prometheus/collectable.h>
#include <prometheus/metric_family.h>

#include <memory>
#include <utility>
#include <vector>

#include "server/access/tls_reload.h"

namespace selfcal::server {

class TlsMetrics final : public prometheus::Collectable {
 public:
  explicit TlsMetrics(std::shared_ptr<const TlsReload> tls)
      : tls_(std::move(tls)) {}

  std::vector<prometheus::MetricFamily> Collect() const override;

 private:
  const std::shared_ptr<const TlsReload> tls_;
};

}  // namespace selfcal::server
