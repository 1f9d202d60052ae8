// The statistics of the cohorts of a hub, the rigs with one value of a label:
// computed from time to time by a thread, and stored as versions.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <mutex>
#include <string>
#include <thread>

#include "server/domain/domain.h"
#include "server/population/population_options.h"

namespace selfcal::server {

// Rigs of which a cohort is estimated: those that were seen last.
inline constexpr int kCohortSample = 500;

// Describes each cohort of the label, stores a version of those whose devices,
// or their active versions, are others than in the newest one, compares all of
// their rigs with it, and gives an alarm to those that contradict it. Returns
// how many versions it stored. A cohort that cannot be described is logged and
// does not hold up the others. Ends early, and without alarms, if `stopping`
// returns true.
absl::StatusOr<int> UpdateCohorts(Domain* domain,
                                  const std::string& label,
                                  std::int64_t now_ns,
                                  const std::function<bool()>& stopping,
                                  int sample = kCohortSample);

class Population {
 public:
  // `domain` outlives it. `now_ns` returns the time since the Unix epoch; any
  // thread may call it.
  Population(Domain* domain,
             const PopulationOptions& options,
             std::function<std::int64_t()> now_ns);
  ~Population();
  Population(const Population&) = delete;
  Population& operator=(const Population&) = delete;

  void Start();
  void Stop();

 private:
  void Run();

  Domain* const domain_;
  const PopulationOptions options_;
  const std::function<std::int64_t()> now_ns_;
  std::mutex mutex_;  // guards what follows
  std::condition_variable stop_;
  bool stopping_ = false;
  std::thread thread_;
};

}  // namespace selfcal::server
