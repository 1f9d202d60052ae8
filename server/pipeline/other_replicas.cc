#include "server/pipeline/other_replicas.h"

#include <algorithm>
#include <utility>

namespace selfcal::server {

void OtherReplicas::Clear() {
  seen_.clear();
  updated_.reset();
}

OtherReplicas::Summary OtherReplicas::Update(
    const std::string& own_name,
    const std::vector<ReplicaRecord>& records,
    Clock::time_point now) {
  // Nobody could beat while the database did not respond.
  const bool missed = !updated_ || now - *updated_ > 3 * beat_;
  updated_ = now;
  Summary summary;
  std::map<std::string, Seen> seen;
  std::string first = own_name;
  for (const ReplicaRecord& record : records) {
    if (record.replica == own_name) continue;
    const auto before = seen_.find(record.replica);
    const bool has_grown =
        before == seen_.end() || before->second.beat != record.beat;
    const Clock::time_point since =
        has_grown || missed ? now : before->second.since;
    seen[record.replica] = {record.beat, since};
    if (now - since > lease_) {
      summary.silent.push_back(record);
    } else {
      first = std::min(first, record.replica);
    }
  }
  seen_ = std::move(seen);
  summary.is_first = first == own_name;
  return summary;
}

}  // namespace selfcal::server
