// The segments that are to be scored, of which each worker claims the next: the
// oldest that is not claimed of the rig whose turn it is. Rigs with unscored
// segments take turns, so that none waits for the many or slow segments of
// another. Any thread may call.
//
// The queue itself is in the store. Claims are only in memory: after a crash
// the store still lists the segment as unscored.
#pragma once

#include <absl/status/statusor.h>

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "server/pipeline/fair_order.h"
#include "server/pipeline/rig_claims.h"
#include "server/store/store.h"

namespace selfcal::server {

class ScoringQueue {
 public:
  struct Claim {
    std::string rig;
    RigClaim of_rig;
    SegmentKey key;
    std::int64_t sequence;
  };
  // Store::ListUnscored. One thread at a time calls it, and meanwhile no claim
  // and no change ends, but segments arrive.
  using ListUnscored =
      std::function<absl::StatusOr<std::vector<Store::Unscored>>()>;

  // Holds the segments of the rigs of `claims`, which must outlive it.
  ScoringQueue(const RigClaims* claims, ListUnscored list_unscored);

  void Open();
  // Ends every wait but WaitForClaims.
  void Close();

  // Lists the unscored segments again: another one has been stored, or has
  // become this daemon's. Never waits for the store.
  void Wake();

  // Claims the next segment as soon as there is one; nullopt once closed.
  std::optional<Claim> Next();
  // Waits until no older segment of the rig is claimed; false if closed before.
  bool WaitForTurn(const Claim& claim);
  // The segment is scored, or cannot be.
  void End(const Claim& claim);

  // Segments of the rig are being quarantined or deleted until EndChange, and
  // no further one is claimed. Returns the sequences of those that are claimed.
  std::set<std::int64_t> BeginChange(const std::string& rig);
  // Waits until no segment of the rig, which is being changed, is claimed.
  void WaitForClaims(const std::string& rig);
  void EndChange(const std::string& rig);

  // Returns false if closed before the time is over.
  bool Pause(std::chrono::milliseconds time);

 private:
  // Returns which of the unscored segments, oldest first, to score next. The
  // lock must be held.
  std::optional<Claim> Choose(const std::vector<Store::Unscored>& unscored);
  // The next two need the lock as well.
  bool IsClaimed(const std::string& rig, std::int64_t sequence) const;
  // True if a segment of the rig is being scored under another claim of it.
  bool IsScoredUnderAnother(const RigClaim& claim) const;

  const RigClaims* const claims_;
  const ListUnscored list_unscored_;
  // Held while unscored segments are listed and one of them is claimed, and to
  // end a claim or a change: a segment on the list that was scored, quarantined
  // or deleted since is still claimed, or its rig still being changed. Locked
  // before mutex_.
  std::mutex choosing_;
  // Guards what follows. The store's thread waits for it when it has stored a
  // segment (Wake), so that nobody may wait for the store while holding it.
  std::mutex mutex_;
  std::condition_variable changed_;
  bool open_ = false;
  std::int64_t wakes_ = 0;
  FairOrder order_;
  // The segments that are being scored, by rig and sequence, with the claim of
  // their rig under which they are. No rig is without segments.
  std::map<std::string, std::map<std::int64_t, RigClaim>> claimed_;
  std::multiset<std::string> changing_;  // rigs
};

}  // namespace selfcal::server
