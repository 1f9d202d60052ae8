#include "server/population/population.h"

#include <spdlog/spdlog.h>

#include <map>
#include <utility>
#include <vector>

#include "proto/safe_text.h"
#include "selfcal/v1/fleet.pb.h"
#include "server/encode/encode_cohort.h"
#include "server/pipeline/cohort_report.h"
#include "server/status/status_macros.h"

namespace selfcal::server {
namespace {

constexpr std::int64_t kKept = 400;      // versions of a cohort
constexpr std::size_t kMostShown = 100;  // characters of a label in the log

// True if the statistics are of the same versions of the same devices.
bool IsOfTheSame(const v1::Cohort& a, const v1::Cohort& b) {
  if (a.devices_size() != b.devices_size()) return false;
  for (int k = 0; k < a.devices_size(); ++k) {
    if (a.devices(k).rig() != b.devices(k).rig() ||
        a.devices(k).version() != b.devices(k).version()) {
      return false;
    }
  }
  return true;
}

struct Described {
  bool is_new = false;  // a version was stored
  CohortFindings findings;
};

absl::StatusOr<Described> DescribeAndStore(
    Store* store,
    const std::string& label,
    const std::string& value,
    std::int64_t now_ns,
    const std::function<bool()>& stopping,
    int sample) {
  RigQuery query;
  query.order = RigQuery::Order::kLastSeen;
  query.descending = true;
  query.labels[label] = value;
  Described described;
  SELFCAL_ASSIGN_OR_RETURN(const CohortReport report,
                           DescribeCohort(store, query, sample, stopping));
  SELFCAL_ASSIGN_OR_RETURN(described.findings,
                           CompareRigs(store, query, report, stopping));
  if (report.calibrated == 0) return described;
  const v1::Cohort cohort = Encode(report);
  SELFCAL_ASSIGN_OR_RETURN(const auto newest,
                           store->ListCohorts(label, value, {1, ""}));
  if (!newest.items.empty()) {
    v1::Cohort before;
    if (before.ParseFromString(newest.items[0].content) &&
        IsOfTheSame(before, cohort)) {
      return described;
    }
  }
  SELFCAL_ASSIGN_OR_RETURN(
      const std::int64_t version,
      store->PutCohort({label, value, 0, now_ns, cohort.SerializeAsString()},
                       kKept));
  described.is_new = version != 0;
  return described;
}

}  // namespace

absl::StatusOr<int> UpdateCohorts(Domain* domain,
                                  const std::string& label,
                                  std::int64_t now_ns,
                                  const std::function<bool()>& stopping,
                                  int sample) {
  Store* const store = domain->store();
  SELFCAL_ASSIGN_OR_RETURN(const std::vector<std::string> values,
                           store->ListLabelValues(label));
  int stored = 0;
  bool all = true;
  CohortFindings findings;
  for (const std::string& value : values) {
    if (stopping()) return stored;
    const auto described =
        DescribeAndStore(store, label, value, now_ns, stopping, sample);
    if (described.ok()) {
      stored += described->is_new;
      findings.insert(described->findings.begin(), described->findings.end());
      continue;
    }
    // Its last rig is gone, or has another label, since the values were read.
    if (absl::IsNotFound(described.status())) continue;
    if (stopping()) return stored;
    all = false;
    spdlog::warn("cannot describe the cohort {}={}: {}",
                 label,
                 SafeLine(value, kMostShown),
                 std::string(described.status().message()));
  }
  SELFCAL_RETURN_IF_ERROR(domain->NoteOutliers(findings, all));
  return stored;
}

Population::Population(Domain* domain,
                       const PopulationOptions& options,
                       std::function<std::int64_t()> now_ns)
    : domain_(domain), options_(options), now_ns_(std::move(now_ns)) {}

Population::~Population() { Stop(); }

void Population::Start() {
  if (!options_.label.empty()) thread_ = std::thread([this] { Run(); });
}

void Population::Stop() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  stop_.notify_all();
  if (thread_.joinable()) thread_.join();
}

void Population::Run() {
  const auto is_stopping = [this] {
    const std::lock_guard lock(mutex_);
    return stopping_;
  };
  const std::chrono::duration<double> interval(options_.interval_s);
  std::unique_lock lock(mutex_);
  while (!stopping_) {
    lock.unlock();
    const auto stored =
        UpdateCohorts(domain_, options_.label, now_ns_(), is_stopping);
    if (!stored.ok()) {
      spdlog::warn("cannot describe the cohorts of the label {}: {}",
                   options_.label,
                   std::string(stored.status().message()));
    } else if (*stored > 0) {
      spdlog::info(
          "cohorts of the label {}: {} new versions", options_.label, *stored);
    }
    lock.lock();
    stop_.wait_for(lock, interval, [this] { return stopping_; });
  }
}

}  // namespace selfcal::server
