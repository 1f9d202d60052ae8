// Statistics of devices of one model, from their calibrations.
#pragma once

#include <absl/status/statusor.h>

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "core/population/consistency.h"
#include "core/population/estimate.h"
#include "server/domain/domain.h"
#include "server/store/store.h"

namespace selfcal::server {

struct CohortReport {
  struct Outlier {
    std::string rig;
    std::int64_t version = 0;
    CohortConsistency consistency;  // with the others
  };
  struct Skipped {
    std::string rig;
    std::string reason;
  };
  // Shares below the quantiles.
  static constexpr std::array<double, 5> kShares = {
      0.05, 0.25, 0.5, 0.75, 0.95};

  struct Device {
    std::string rig;
    std::int64_t version = 0;
  };

  StoredRig reference;  // whose prior mean is cohort.reference
  int rigs = 0;         // looked at
  int calibrated = 0;
  bool truncated = false;  // there are more
  Cohort cohort;
  Eigen::MatrixXd quantiles;      // D x kShares.size(), of offsets [reference]
  std::vector<Device> devices;    // the calibrated ones, by name
  std::vector<Outlier> outliers;  // the least likely first
  std::vector<Skipped> skipped;
};

// Looks at `max_rigs` of the rigs of the query, in its order. The first one is
// the reference; rigs with other cameras do not count, nor do those whose
// factory calibration is active. NOT_FOUND if there is no rig, CANCELLED soon
// after `cancelled` returns true.
absl::StatusOr<CohortReport> DescribeCohort(
    Store* store,
    const RigQuery& query,
    int max_rigs,
    const std::function<bool()>& cancelled = [] { return false; });

// Compares all rigs of the query with the cohort of its report, also those
// beyond `max_rigs`. CANCELLED soon after `cancelled` returns true.
absl::StatusOr<CohortFindings> CompareRigs(
    Store* store,
    RigQuery query,
    const CohortReport& report,
    const std::function<bool()>& cancelled);

}  // namespace selfcal::server
