// The rigs that sent last: the ones that have series of their own.
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
  // At most `limit`, in the order of their names.
  std::vector<std::string> List() const;

 private:
  const int limit_;
  mutable std::mutex mutex_;
  std::list<std::string> rigs_;  // newest first
};

// The label for a group of parameters: its name, or "other" for names that a
// client made up.
std::string GroupLabel(std::string_view group);

}  // namespace selfcal::server
