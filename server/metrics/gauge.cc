#include "server/metrics/gauge.h"

#include <utility>

namespace selfcal::server {

Gauge::Gauge(const std::string& name, const std::string& help) {
  family_.name = name;
  family_.help = help;
  family_.type = prometheus::MetricType::Gauge;
}

void Gauge::Add(std::vector<prometheus::ClientMetric::Label> labels,
                double value) {
  prometheus::ClientMetric metric;
  metric.label = std::move(labels);
  metric.gauge.value = value;
  family_.metric.push_back(std::move(metric));
}

prometheus::MetricFamily Gauge::Take() { return std::move(family_); }

}  // namespace selfcal::server
