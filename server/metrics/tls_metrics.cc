#include "server/metrics/tls_metrics.h"

#include "server/metrics/gauge.h"

namespace selfcal::server {

std::vector<prometheus::MetricFamily> TlsMetrics::Collect() const {
  Gauge expiry("selfcal_tls_expiry_timestamp_seconds",
               "When the TLS certificate in force expires.");
  expiry.Add({}, static_cast<double>(tls_->Current()->expiry_s));
  Gauge refused("selfcal_tls_files_refused",
                "1 if the TLS files on disk cannot be used, so that those "
                "before them are in force; otherwise 0.");
  refused.Add({}, tls_->Problem().empty() ? 0 : 1);
  return {expiry.Take(), refused.Take()};
}

}  // namespace selfcal::server
