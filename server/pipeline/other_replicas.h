// What a replica knows of the others on its database: their beats, and for how
// long these have not grown. One thread at a time may call.
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "server/pipeline/pipeline.h"
#include "server/store/replicas.h"

namespace selfcal::server {

class OtherReplicas {
 public:
  using Clock = std::chrono::steady_clock;

  struct Summary {
    // Those whose beat has not grown for longer than the lease.
    std::vector<ReplicaRecord> silent;
    // The name of this replica is the first of those that are not silent.
    bool is_first = false;
  };

  explicit OtherReplicas(const ReplicaOptions& options)
      : beat_(options.beat), lease_(options.lease) {}

  void Clear();
  // Compares the records of all replicas, read at `now`, with those of the last
  // call. A silent one remains so as long as its record is listed unchanged.
  Summary Update(const std::string& own_name,
                 const std::vector<ReplicaRecord>& records,
                 Clock::time_point now);

 private:
  struct Seen {
    std::int64_t beat = 0;
    Clock::time_point since;
  };

  const std::chrono::milliseconds beat_;
  const std::chrono::milliseconds lease_;
  std::map<std::string, Seen> seen_;  // by name
  std::optional<Clock::time_point> updated_;
};

}  // namespace selfcal::server
