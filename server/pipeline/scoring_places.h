// The places of a backlog that segments fill until they are scored. Any thread
// may call.
#pragma once

#include <absl/status/status.h>

#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <vector>

#include "server/pipeline/backlog.h"

namespace selfcal::server {

class ScoringPlaces {
 public:
  explicit ScoringPlaces(int limit) : backlog_(limit) {}

  // Backlog::Open, with the places that segments fill already.
  void Open(const std::map<std::string, int>& filled);
  void Close() { backlog_.Close(); }

  // Backlog::Take.
  absl::Status Take(const std::string& rig,
                    const std::function<bool()>& cancelled) {
    return backlog_.Take(rig, cancelled);
  }
  // The place is filled by a stored segment, or was not needed.
  void Fill(const std::string& rig);
  void Return(const std::string& rig) { backlog_.Return(rig); }
  // So many segments of the rig no longer wait for their scores.
  void Empty(const std::string& rig, int places);

  std::vector<std::string> FilledRigs() const;
  // Only so many segments of the rig still wait for their scores.
  void EmptyAllBut(const std::string& rig, std::int64_t unscored);

 private:
  // The lock must be held.
  void EmptyLocked(const std::string& rig, std::int64_t places);

  Backlog backlog_;
  mutable std::mutex mutex_;                    // guards filled_
  std::map<std::string, std::int64_t> filled_;  // by rig; without zeros
};

}  // namespace selfcal::server
