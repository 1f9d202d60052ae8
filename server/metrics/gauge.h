// A gauge whose values are stated anew at each collection.
#pragma once

#include <prometheus/client_metric.h>
#include <prometheus/metric_family.h>

#include <string>
#include <vector>

namespace selfcal::server {

class Gauge {
 public:
  Gauge(const std::string& name, const std::string& help);

  void Add(std::vector<prometheus::ClientMetric::Label> labels, double value);
  prometheus::MetricFamily Take();

 private:
  prometheus::MetricFamily family_;
};

}  // namespace selfcal::server
