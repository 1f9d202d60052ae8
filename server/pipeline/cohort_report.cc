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

// A rig as a device of a cohort.
struct Measured {
  std::string skipped;  // why it does not count; empty if it does
  // Its calibration says whether it is like the others: it has one, or none is
  // active but that of the factory, which contradicts nothing.
  bool comparable = false;
  std::int64_t version = 0;
  Eigen::VectorXd offset;  // of theta from the reference
  ThetaInformation information;
};

absl::StatusOr<Measured> Measure(Store* store,
                                 const Rig& rig,
                                 const Calibration& reference) {
  Measured measured;
  if (!SameShape(rig.factory, reference)) {
    measured.skipped = "its cameras are not like those of the reference";
    return measured;
  }
  const auto active = store->GetActiveCalibration(rig.id);
  if (absl::IsNotFound(active.status()) || absl::IsDataLoss(active.status())) {
    measured.skipped = std::string(active.status().message());
    return measured;
  }
  SELFCAL_RETURN_IF_ERROR(active.status());
  measured.comparable = true;
  if (active->version == 1) {
    measured.skipped = "its factory calibration is active";
    return measured;
  }
  measured.version = active->version;
  measured.offset = BoxMinus(active->theta, reference);
  measured.information =
      DeviceInformation(rig, active->theta, active->covariance, reference);
  return measured;
}

class Reader {
 public:
  Reader(Store* store, CohortReport* report) : store_(store), report_(report) {}

  // Adds the rig, or says why it does not count.
  absl::Status Read(const StoredRig& stored) {
    const Rig& rig = stored.rig;
    if (report_->rigs++ == 0) {
      report_->reference = stored;
      reference_ = PriorMean(rig);
      scale_ = PriorSigmas(rig);
    }
    SELFCAL_ASSIGN_OR_RETURN(Measured measured,
                             Measure(store_, rig, reference_));
    if (!measured.skipped.empty()) {
      report_->skipped.push_back({rig.id, std::move(measured.skipped)});
      return absl::OkStatus();
    }
    informations_.push_back(std::move(measured.information));
    devices_.push_back({rig.id, measured.version, std::move(measured.offset)});
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

// The findings about the rigs that the cohort was estimated of.
CohortFindings FindingsOf(const CohortReport& report) {
  CohortFindings findings;
  for (const CohortReport::Device& device : report.devices) {
    findings[device.rig] = 0;
  }
  for (const CohortReport::Outlier& outlier : report.outliers) {
    findings[outlier.rig] = outlier.version;
  }
  return findings;
}

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

absl::StatusOr<CohortFindings> CompareRigs(
    Store* store,
    RigQuery query,
    const CohortReport& report,
    const std::function<bool()>& cancelled) {
  // A list by name misses no rig that is seen meanwhile.
  query.order = RigQuery::Order::kName;
  CohortFindings findings = FindingsOf(report);
  const bool estimated = std::ssize(report.cohort.devices) >= kLeastCohort;
  // As for those that the cohort was estimated of.
  const double limit = CohortOptions().false_alarm / report.calibrated;
  Page page{kRigsOfPage, ""};
  do {
    SELFCAL_ASSIGN_OR_RETURN(const Listed<StoredRig> rigs,
                             store->ListRigs(query, page));
    for (const StoredRig& stored : rigs.items) {
      if (cancelled()) return absl::CancelledError("cancelled");
      if (findings.contains(stored.rig.id)) continue;
      SELFCAL_ASSIGN_OR_RETURN(
          const Measured measured,
          Measure(store, stored.rig, report.cohort.reference));
      std::optional<std::int64_t>& finding = findings[stored.rig.id];
      if (!measured.comparable) continue;
      const bool unlike =
          estimated && measured.skipped.empty() &&
          CompareWithCohort(report.cohort, measured.information).probability <
              limit;
      finding = unlike ? measured.version : 0;
    }
    page.token = rigs.next_token;
  } while (!page.token.empty());
  return findings;
}

}  // namespace selfcal::server
