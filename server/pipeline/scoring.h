// The threads that score: each claims the oldest segment that is not claimed of
// the rig whose turn it is, scores it without a lock, and commits the score
// when all older ones of its rig are committed. Rigs with unscored segments
// take turns, so that none waits for the many or slow segments of another.
// Claims are only in memory: after a crash the store still lists the segment as
// unscored.
//
// A segment is scored at the active calibration, whatever version its states
// were estimated with, so that scores refer to the present calibration even if
// a SLAM process never takes a new version.
#pragma once

#include <absl/status/status.h>
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
#include <thread>
#include <utility>
#include <vector>

#include "server/domain/domain.h"
#include "server/pipeline/backlog.h"
#include "server/pipeline/fair_order.h"
#include "server/pipeline/pipeline.h"
#include "server/pipeline/rig_claims.h"
#include "server/store/store.h"

namespace selfcal::server {

class ScoringWorkers {
 public:
  // Scores the segments of the rigs of `claims`. `on_run` is called on a worker
  // for each run that a commit creates, `on_change` with the rig of each change
  // of a device that one finds, `on_done` with the rig of each segment that a
  // worker is done with.
  ScoringWorkers(Domain* domain,
                 RigClaims* claims,
                 const PipelineOptions& options,
                 Estimators estimators,
                 std::function<void(const StoredRun&)> on_run,
                 std::function<void(const std::string&)> on_change,
                 std::function<void(const std::string&)> on_done);
  ~ScoringWorkers();

  absl::Status Start();
  // Returns when every thread has ended, each after its current segment.
  void Stop();

  // A place for a segment of the rig in the backlog (Backlog::Take).
  absl::Status TakePlace(const std::string& rig,
                         const std::function<bool()>& cancelled);
  // The place is filled by a stored segment, or was not needed.
  void FillPlace(const std::string& rig);
  void ReturnPlace(const std::string& rig);
  // Looks for unscored segments in the store, and returns the places of those
  // that other daemons have scored.
  void Wake();

  // Calls Domain::QuarantineSegments, and returns the places of the segments
  // that were waiting for their score.
  absl::StatusOr<QuarantineCommit> Quarantine(
      const std::string& rig,
      const std::function<absl::StatusOr<QuarantineCommit>()>& change);

  // Deletes segments of the rig by `change`, while none of them is being
  // scored; it returns how many were waiting for their scores, whose places are
  // given back. Errors of `change`.
  absl::Status Delete(const std::string& rig,
                      const std::function<absl::StatusOr<int>()>& change);

 private:
  struct Claim {
    std::string rig;
    RigClaim of_rig;
    SegmentKey key;
    std::int64_t sequence;
  };
  // Results for a segment.
  struct Score {
    SegmentInformation information;
    std::optional<SegmentEnds> ends;
    ScoreBasis basis;  // that it was computed with
  };

  void Run();
  std::optional<Claim> NextClaim();
  // Returns which of the unscored segments, oldest first, to score next. The
  // lock must be held.
  std::optional<Claim> Choose(const std::vector<Store::Unscored>& unscored);
  // True if a segment of the rig is being scored under another claim of it. The
  // lock must be held.
  bool IsScoredUnderAnother(const RigClaim& claim) const;
  void ReturnPlacesOfOthers();
  // Segments of the rig may be claimed again; so many that waited for their
  // scores no longer do.
  void EndChange(const std::string& rig, int waiting);
  // The lock must be held.
  void EmptyPlaces(const std::string& rig, int places);
  void Process(const Claim& claim);
  // The score, or what is wrong with the segment. nullopt when stopping.
  std::optional<absl::StatusOr<Score>> FindScore(const Claim& claim);
  absl::StatusOr<Score> TryScore(const Claim& claim);
  bool WaitForTurn(const Claim& claim);
  void Commit(const Claim& claim, const absl::StatusOr<Score>& score);
  absl::Status TryCommit(const Claim& claim, const Score& score);
  // Computes a score again that was committed with an outdated basis.
  void ScoreAgain(const Claim& claim);
  void Quarantine(const Claim& claim, const absl::Status& why);
  // Repeats the call until it succeeds or fails for good; when stopping,
  // returns the last result.
  absl::Status Retry(const std::function<absl::Status()>& call);
  bool Pause(std::chrono::milliseconds time);  // false when stopping

  Domain* const domain_;
  Store* const store_;
  RigClaims* const claims_;
  const PipelineOptions options_;
  const Estimators estimators_;
  const std::function<void(const StoredRun&)> on_run_;
  const std::function<void(const std::string&)> on_change_;
  const std::function<void(const std::string&)> on_done_;

  Backlog backlog_;
  // Guards what follows. The store's thread waits for it when it has stored a
  // segment (FillPlace), so that nobody may wait for a write while holding it.
  std::mutex mutex_;
  std::condition_variable changed_;
  bool running_ = false;
  std::int64_t arrivals_ = 0;  // reasons to look for segments, since the start
  std::map<std::string, std::int64_t> filled_;  // places in the backlog, by rig
  FairOrder order_;
  // Rig and sequence of the segments that are being scored, and the claim of
  // their rig under which they are.
  std::map<std::pair<std::string, std::int64_t>, RigClaim> claimed_;
  // Rigs whose segments are being quarantined or deleted: no further one of
  // them is claimed.
  std::multiset<std::string> changing_;
  std::vector<std::thread> threads_;
};

}  // namespace selfcal::server
