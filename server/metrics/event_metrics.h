// Metrics that count the events which the pipeline reports to its observer.
#pragma once

#include <prometheus/counter.h>
#include <prometheus/histogram.h>
#include <prometheus/registry.h>

#include <chrono>
#include <cstdint>
#include <map>
#include <mutex>
#include <string>
#include <utility>

#include "server/metrics/recent_rigs.h"
#include "server/pipeline/observer.h"
#include "server/store/store.h"

namespace selfcal::server {

class EventMetrics final : public PipelineObserver {
 public:
  // All three must outlive it.
  EventMetrics(Store* store, RecentRigs* rigs, prometheus::Registry* registry);

  void OnVerdict(const std::string& rig, Verdict verdict) override;
  void OnScore(const SegmentInformation& information, double seconds) override;
  void OnRun(const StoredRun& run) override;
  void OnCheck(CheckSubject subject, VerificationOutcome outcome) override;

 private:
  using RunId = std::pair<std::string, std::int64_t>;

  // Counts the outcome of a run that has ended, and the verdict on its version.
  void CountEnd(const StoredRun& run);

  Store* const store_;
  RecentRigs* const rigs_;
  prometheus::Family<prometheus::Counter>& segments_;
  prometheus::Histogram& scoring_;
  prometheus::Family<prometheus::Histogram>& entropy_;
  prometheus::Family<prometheus::Counter>& runs_;
  prometheus::Family<prometheus::Counter>& verdicts_;
  prometheus::Histogram& run_seconds_;
  prometheus::Family<prometheus::Counter>& checks_;
  std::mutex mutex_;  // guards the members below
  // Start times of active runs; usually there is one.
  std::map<RunId, std::chrono::steady_clock::time_point> started_;
};

}  // namespace selfcal::server
