// Metrics of the present state, when Prometheus reads them: tables, versions
// and times of the rigs that sent last, the queue, what devices have reported,
// disk and memory.
#pragma once

#include <prometheus/collectable.h>
#include <prometheus/metric_family.h>

#include <filesystem>
#include <vector>

#include "server/metrics/recent_rigs.h"
#include "server/store/store.h"

namespace selfcal::server {

class StateMetrics final : public prometheus::Collectable {
 public:
  // `store` and `rigs` must outlive it.
  StateMetrics(Store* store,
               const RecentRigs* rigs,
               std::filesystem::path database);

  // Returns all metrics, except those that cannot be read.
  std::vector<prometheus::MetricFamily> Collect() const override;

 private:
  Store* const store_;
  const RecentRigs* const rigs_;
  const std::filesystem::path database_;
};

}  // namespace selfcal::server
