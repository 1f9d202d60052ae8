// The segments that are stored and unscored, or about to be stored: at most so
// many, shared fairly among rigs. Any thread may call.
#pragma once

#include <absl/status/status.h>

#include <condition_variable>
#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <utility>

namespace selfcal::server {

// Beyond its limit, it has room only for a rig that has no place: a rig that
// sends little never waits for those that send much.
class Backlog {
 public:
  explicit Backlog(int limit) : limit_(limit) {}

  // Places may be taken from Open on, which is given those that are taken
  // already, by rig, until Close.
  void Open(std::map<std::string, int> taken);
  void Close();

  // Waits for room and takes a place. Among those who wait, the rig with the
  // fewest places is next, then the first who came. CANCELLED once `cancelled`
  // returns true, UNAVAILABLE while it is closed.
  absl::Status Take(const std::string& rig,
                    const std::function<bool()>& cancelled);
  void Return(const std::string& rig, int places = 1);

 private:
  bool IsNext(std::int64_t ticket, const std::string& rig) const;
  int TakenBy(const std::string& rig) const;

  const int limit_;
  mutable std::mutex mutex_;  // guards what follows
  std::condition_variable changed_;
  bool open_ = false;
  int total_ = 0;
  std::map<std::string, int> taken_;  // by rig; without zeros
  std::int64_t next_ticket_ = 0;
  std::map<std::int64_t, std::string> waiting_;  // rigs by ticket
};

}  // namespace selfcal::server
