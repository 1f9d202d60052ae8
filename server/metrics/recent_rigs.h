// The rigs that sent last, which have their own series.
#pragma once

#include <list>
#include <mutex>
#include <string>
#include <string_view>
#include <vector>

namespace selfcal::server {

// Any thread may call.
class RecentRigs {
 public:
  explicit RecentRigs(int limit) : limit_(limit) {}

  void Heard(const std::string& rig);
  // Returns at most `limit` rigs, sorted by name.
  std::vector<std::string> List() const;

 private:
  const int limit_;
  mutable std::mutex mutex_;
  std::list<std::string> rigs_;  // newest first
};

// The label of a group of parameters: its name, or "other" for names that a
// client has defined.
std::string GroupLabel(std::string_view group);

}  // namespace selfcal::server
