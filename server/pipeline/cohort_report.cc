#include "server/pipeline/cohort_report.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/population/device.h"
#include "server/status/status_macros.h"

namespace selfcal::server {
namespace {

constexpr int kRigsOfPage = 200;

struct Device {
  std::string rig;
  std::int64_t version = 0;
  Eigen::VectorXd offset;  // of theta from the reference
};

class Reader {
 public:
  Reader(Store* store, CohortReport* report) : store_(store), report_(report) {}

  // Adds the rig, or says why it does not count.
  absl::Status Read(const StoredRig& stored) {
    const Rig& rig = stored.rig;
    if (report_->rigs++ == 0) {
      report_->reference = stored;
      reference_ = rig.factory;
      scale_ = PriorSigmas(rig);
    } else if (!SameShape(rig.factory, reference_)) {
      return Skip(rig.id, "its cameras are not like those of the reference");
    }
    auto active = store_->GetActiveCalibration(rig.id);
    if (absl::IsNotFound(active.status()) ||
        absl::IsDataLoss(active.status())) {
      return Skip(rig.id, std::string(active.status().message()));
    }
    SELFCAL_RETURN_IF_ERROR(active.status());
    if (active->version == 1) {
      return Skip(rig.id, "its factory calibration is active");
    }
    informations_.push_back(
        DeviceInformation(rig, active->theta, active->covariance, reference_));
    devices_.push_back(
        {rig.id, active->version, BoxMinus(active->theta, reference_)});
    return absl::OkStatus();
  }

  void Conclude(const std::function<bool()>& cancelled) {
    report_->calibrated = static_cast<int>(devices_.size());
    CohortOptions options;
    options.cancelled = cancelled;
    report_->cohort =
        EstimateCohort(reference_, scale_, informations_, options);
    FindQuantiles();
    for (const Device& device : devices_) {
      report_->devices.push_back({device.rig, device.version});
    }
    std::sort(report_->devices.begin(),
              report_->devices.end(),
              [](const auto& a, const auto& b) { return a.rig < b.rig; });
    for (const int index : report_->cohort.outliers) {
      report_->outliers.push_back(
          {devices_[index].rig,
           devices_[index].version,
           CompareWithCohort(report_->cohort, informations_[index])});
    }
    std::sort(report_->outliers.begin(),
              report_->outliers.end(),
              [](const auto& a, const auto& b) {
                return a.consistency.probability < b.consistency.probability;
              });
  }

 private:
  absl::Status Skip(const std::string& rig, const std::string& reason) {
    report_->skipped.push_back({rig, reason});
    return absl::OkStatus();
  }

  void FindQuantiles() {
    const auto& shares = CohortReport::kShares;
    report_->quantiles.setZero(scale_.size(), shares.size());
    if (devices_.empty()) return;
    std::vector<double> values(devices_.size());
    for (Eigen::Index j = 0; j < scale_.size(); ++j) {
      for (std::size_t i = 0; i < devices_.size(); ++i) {
        values[i] = devices_[i].offset(j);
      }
      std::sort(values.begin(), values.end());
      for (std::size_t q = 0; q < shares.size(); ++q) {
        const auto at =
            std::lround(shares[q] * static_cast<double>(values.size() - 1));
        report_->quantiles(j, static_cast<Eigen::Index>(q)) =
            values[static_cast<std::size_t>(at)];
      }
    }
  }

  Store* const store_;
  CohortReport* const report_;
  Calibration reference_;
  Eigen::VectorXd scale_;
  std::vector<Device> devices_;
  std::vector<ThetaInformation> informations_;  // of the devices
};

}  // namespace

absl::StatusOr<CohortReport> DescribeCohort(
    Store* store,
    const RigQuery& query,
    int max_rigs,
    const std::function<bool()>& cancelled) {
  CohortReport report;
  Reader reader(store, &report);
  Page page{std::min(kRigsOfPage, max_rigs), ""};
  do {
    SELFCAL_ASSIGN_OR_RETURN(const Listed<StoredRig> rigs,
                             store->ListRigs(query, page));
    for (const StoredRig& rig : rigs.items) {
      if (report.rigs == max_rigs) {
        report.truncated = true;
        break;
      }
      if (cancelled()) return absl::CancelledError("cancelled");
      SELFCAL_RETURN_IF_ERROR(reader.Read(rig));
    }
    page.token = rigs.next_token;
  } while (!page.token.empty() && !report.truncated);
  if (report.rigs == 0) {
    return absl::NotFoundError("no rig is like that");
  }
  reader.Conclude(cancelled);
  if (cancelled()) return absl::CancelledError("cancelled");
  return report;
}

}  // namespace selfcal::server
