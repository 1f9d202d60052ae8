// The threads that score: each claims the next segment (scoring_queue.h),
// scores it without a lock, and commits the score when all older ones of its
// rig are committed.
//
// A segment is scored at the active calibration, whatever version its states
// were estimated with, so that scores refer to the present calibration even if
// a SLAM process never takes a new version.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <algorithm>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "server/domain/domain.h"
#include "server/pipeline/pipeline.h"
#include "server/pipeline/rig_claims.h"
#include "server/pipeline/scoring_places.h"
#include "server/pipeline/scoring_queue.h"
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
  using Claim = ScoringQueue::Claim;
  // Results for a segment.
  struct Score {
    SegmentInformation information;
    std::optional<SegmentEnds> ends;
    ScoreBasis basis;  // that it was computed with
  };

  void Run();
  void ReturnPlacesOfOthers();
  // So many segments of the rig no longer wait for their scores.
  void EndChange(const std::string& rig, int waiting);
  void Process(const Claim& claim);
  // The score, or what is wrong with the segment. nullopt when stopping.
  std::optional<absl::StatusOr<Score>> FindScore(const Claim& claim);
  absl::StatusOr<Score> TryScore(const Claim& claim);
  void Commit(const Claim& claim, const absl::StatusOr<Score>& score);
  absl::Status TryCommit(const Claim& claim, const Score& score);
  // Computes a score again that was committed with an outdated basis.
  void ScoreAgain(const Claim& claim);
  void Quarantine(const Claim& claim, const absl::Status& why);
  // Repeats the call until it succeeds or fails for good; when stopping,
  // returns the last result.
  absl::Status Retry(const std::function<absl::Status()>& call);
  Store* store() const { return domain_->store(); }
  int ThreadCount() const { return std::max(1, options_.scoring_threads); }

  Domain* const domain_;
  RigClaims* const claims_;
  const PipelineOptions options_;
  const Estimators estimators_;
  const std::function<void(const StoredRun&)> on_run_;
  const std::function<void(const std::string&)> on_change_;
  const std::function<void(const std::string&)> on_done_;
  ScoringPlaces places_;
  ScoringQueue queue_;
  std::mutex mutex_;                  // guards threads_
  std::vector<std::thread> threads_;  // none unless it is started
};

}  // namespace selfcal::server
