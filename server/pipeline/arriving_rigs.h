// Rigs whose segments arrive at this replica while it does not hold them: it
// looks once between two of its beats whether it can claim one, not with each
// segment, since most are held by other replicas. Any thread may call.
#pragma once

#include <mutex>
#include <set>
#include <string>

namespace selfcal::server {

class ArrivingRigs {
 public:
  // A segment of the rig was stored. Returns false if others hold the rig, as
  // far as is known.
  bool Note(const std::string& rig);
  // Rigs noted since the last call; taken before unclaimed rigs are listed.
  std::set<std::string> Take();
  // These could not be claimed: others hold them.
  void NoteForeign(const std::set<std::string>& rigs);
  // Called with each beat: others may have given up what they held.
  void ForgetForeign();

 private:
  std::mutex mutex_;               // guards what follows
  std::set<std::string> arrived_;  // since Take
  std::set<std::string> foreign_;  // others hold these
};

}  // namespace selfcal::server
