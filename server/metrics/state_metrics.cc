#include "server/metrics/state_metrics.h"

#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <future>
#include <map>
#include <string>
#include <system_error>
#include <utility>

#include "server/domain/alarms.h"
#include "server/domain/clock.h"
#include "server/metrics/gauge.h"
#include "server/pipeline/verdict.h"
#include "server/store/outbox.h"

namespace selfcal::server {
namespace {

using prometheus::MetricFamily;

void AddTables(Store* store,
               const std::vector<std::string>& rigs,
               std::vector<MetricFamily>* families) {
  Gauge entries("selfcal_table_entries", "Segments in the tables of a group.");
  Gauge capacity("selfcal_table_capacity",
                 "Segments that the tables of a group can hold.");
  Gauge version("selfcal_active_version", "Number of the active calibration.");
  Gauge verdict("selfcal_active_verdict",
                "Constant 1, with the verdict on the active calibration as "
                "label.");
  for (const std::string& rig : rigs) {
    // Several groups can have the label "other".
    std::map<std::string, std::pair<double, double>> groups;
    const auto tables = store->GetTables(rig);
    if (!tables.ok()) continue;
    for (const Table& table : *tables) {
      auto& [held, room] = groups[GroupLabel(table.group)];
      held += static_cast<double>(table.entries.size());
      room += table.capacity;
    }
    for (const auto& [group, fill] : groups) {
      entries.Add({{"rig", rig}, {"group", group}}, fill.first);
      capacity.Add({{"rig", rig}, {"group", group}}, fill.second);
    }
    const auto active = store->GetActiveCalibration(rig);
    if (!active.ok()) continue;
    version.Add({{"rig", rig}}, static_cast<double>(active->version));
    verdict.Add(
        {{"rig", rig}, {"verdict", VerdictText(VerdictOf(*active).kind)}}, 1);
  }
  families->push_back(entries.Take());
  families->push_back(capacity.Take());
  families->push_back(version.Take());
  families->push_back(verdict.Take());
}

// Seconds since the Unix epoch; 0 stays 0.
double Timestamp(std::int64_t time_ns) {
  constexpr double kNsPerS = 1e9;
  return static_cast<double>(time_ns) / kNsPerS;
}

void AddTimes(Store* store,
              const std::vector<std::string>& rigs,
              std::vector<MetricFamily>* families) {
  Gauge active("selfcal_active_since_timestamp_seconds",
               "When the active calibration became active.");
  Gauge change("selfcal_device_change_timestamp_seconds",
               "When the newest device change was detected; 0: none.");
  Gauge segment("selfcal_last_segment_timestamp_seconds",
                "When the newest segment arrived; 0: none.");
  RigQuery newest;
  newest.order = RigQuery::Order::kLastSeen;
  newest.descending = true;
  const auto summaries = store->ListRigSummaries(
      newest,
      {.size = std::max(1, static_cast<int>(rigs.size())), .token = ""});
  if (summaries.ok()) {
    for (const RigSummary& rig : summaries->items) {
      if (!std::binary_search(rigs.begin(), rigs.end(), rig.rig)) continue;
      active.Add({{"rig", rig.rig}}, Timestamp(rig.active_since_ns));
      change.Add({{"rig", rig.rig}}, Timestamp(rig.newest_change_ns));
      segment.Add({{"rig", rig.rig}}, Timestamp(rig.last_seen_ns));
    }
  }
  families->push_back(active.Take());
  families->push_back(change.Take());
  families->push_back(segment.Take());
}

void AddQueue(Store* store, std::vector<MetricFamily>* families) {
  Gauge queue("selfcal_queue_length", "Segments that wait to be scored.");
  const auto work = store->CountWork();
  if (work.ok()) queue.Add({}, static_cast<double>(work->segments));
  families->push_back(queue.Take());
  Gauge runs("selfcal_unfinished_runs", "Runs that are pending or running.");
  if (work.ok()) runs.Add({}, static_cast<double>(work->runs));
  families->push_back(runs.Take());
}

void AddUplink(Store* store,
               const std::vector<std::string>& rigs,
               std::vector<MetricFamily>* families) {
  Gauge waiting("selfcal_uplink_waiting_records",
                "Records that wait to be reported to the hub.");
  Gauge time("selfcal_uplink_last_report_timestamp_seconds",
             "When the hub took the last report of the rig; 0: none so far.");
  const auto reported = store->outbox()->List();
  if (reported.ok()) {
    for (const ReportedRig& rig : *reported) {
      if (!std::binary_search(rigs.begin(), rigs.end(), rig.rig)) continue;
      if (rig.deleted) continue;
      waiting.Add({{"rig", rig.rig}}, static_cast<double>(rig.waiting));
      time.Add({{"rig", rig.rig}}, Timestamp(rig.time_ns));
    }
  }
  families->push_back(waiting.Take());
  families->push_back(time.Take());
}

// The rigs that devices report to this hub, all together: there are many.
void AddHub(Store* store, std::vector<MetricFamily>* families) {
  Gauge rigs("selfcal_hub_rigs", "Rigs that devices report to this hub.");
  Gauge silent("selfcal_hub_silent_rigs",
               "Rigs of which the hub has taken no report for a day.");
  Gauge waiting("selfcal_hub_waiting_records",
                "Records that waited at the devices at their last reports.");
  Gauge oldest("selfcal_hub_oldest_report_timestamp_seconds",
               "Earliest time of the last reports of all rigs; 0: none.");
  Gauge newest("selfcal_hub_newest_report_timestamp_seconds",
               "Latest time of the last reports of all rigs; 0: none.");
  const auto count = store->CountReported(NowNs() - kSilentAfterNs);
  if (count.ok()) {
    rigs.Add({}, static_cast<double>(count->rigs));
    silent.Add({}, static_cast<double>(count->silent));
    waiting.Add({}, static_cast<double>(count->waiting));
    oldest.Add({}, Timestamp(count->oldest_ns));
    newest.Add({}, Timestamp(count->newest_ns));
  }
  for (Gauge* gauge : {&rigs, &silent, &waiting, &oldest, &newest}) {
    families->push_back(gauge->Take());
  }
}

void AddDisk(const std::filesystem::path& database,
             std::vector<MetricFamily>* families) {
  Gauge bytes("selfcal_database_bytes", "Size of the database files.");
  for (const auto& [label, suffix] :
       {std::pair<const char*, const char*>{"database", ""}, {"log", "-wal"}}) {
    std::error_code error;
    const auto size =
        std::filesystem::file_size(database.string() + suffix, error);
    if (!error) bytes.Add({{"file", label}}, static_cast<double>(size));
  }
  families->push_back(bytes.Take());
  Gauge free("selfcal_disk_free_bytes",
             "Free space on the disk of the database, for the daemon's user.");
  std::error_code error;
  const auto space = std::filesystem::space(database.parent_path(), error);
  if (!error) free.Add({}, static_cast<double>(space.available));
  families->push_back(free.Take());
}

void AddMemory(std::vector<MetricFamily>* families) {
  Gauge memory("process_resident_memory_bytes", "Resident memory.");
  std::ifstream statm("/proc/self/statm");
  double total_pages = 0, resident_pages = 0;
  if (statm >> total_pages >> resident_pages) {
    memory.Add({}, resident_pages * static_cast<double>(sysconf(_SC_PAGESIZE)));
  }
  families->push_back(memory.Take());
}

}  // namespace

StateMetrics::StateMetrics(Store* store,
                           const RecentRigs* rigs,
                           std::filesystem::path database)
    : store_(store), rigs_(rigs), database_(std::move(database)) {}

std::vector<MetricFamily> StateMetrics::Collect() const {
  // Reads on another thread, because the threads of the HTTP server have a
  // stack of 100 KiB, most of which the server itself uses.
  return std::async(std::launch::async,
                    [this] {
                      std::vector<MetricFamily> families;
                      const std::vector<std::string> rigs = rigs_->List();
                      AddTables(store_, rigs, &families);
                      AddTimes(store_, rigs, &families);
                      AddQueue(store_, &families);
                      AddUplink(store_, rigs, &families);
                      AddHub(store_, &families);
                      if (!database_.empty()) AddDisk(database_, &families);
                      AddMemory(&families);
                      return families;
                    })
      .get();
}

}  // namespace selfcal::server
