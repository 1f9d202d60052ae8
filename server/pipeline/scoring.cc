#include "server/pipeline/scoring.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <exception>
#include <limits>
#include <map>
#include <set>
#include <utility>

#include "server/pipeline/backoff.h"
#include "server/status/status_macros.h"

namespace selfcal::server {
namespace {

std::string Name(const std::string& rig, const SegmentKey& key) {
  return fmt::format("segment {}~{} of rig {}", key.session, key.index, rig);
}

template <typename Score>
bool IsFinite(const Score& score) {
  return score.information.Lambda.allFinite() &&
         score.information.eta.allFinite() &&
         (!score.ends ||
          (score.ends->Lambda.allFinite() && score.ends->eta.allFinite()));
}

}  // namespace

ScoringWorkers::ScoringWorkers(
    Domain* domain,
    RigClaims* claims,
    const PipelineOptions& options,
    Estimators estimators,
    std::function<void(const StoredRun&)> on_run,
    std::function<void(const std::string&)> on_change,
    std::function<void(const std::string&)> on_done)
    : domain_(domain),
      claims_(claims),
      options_(options),
      estimators_(std::move(estimators)),
      on_run_(std::move(on_run)),
      on_change_(std::move(on_change)),
      on_done_(std::move(on_done)),
      places_(options.max_backlog),
      // Each of the other threads scores at most one segment of a rig.
      queue_(claims, [this] {
        return store()->ListUnscored(ThreadCount(), claims_->replica());
      }) {}

ScoringWorkers::~ScoringWorkers() { Stop(); }

absl::Status ScoringWorkers::Start() {
  // Each of several daemons counts what it has received itself.
  std::vector<Store::Unscored> left;
  if (!options_.replica.shared) {
    SELFCAL_ASSIGN_OR_RETURN(
        left, store()->ListUnscored(std::numeric_limits<int>::max()));
  }
  std::map<std::string, int> filled;
  for (const Store::Unscored& segment : left) ++filled[segment.rig];
  const std::lock_guard lock(mutex_);
  if (!threads_.empty()) {
    return absl::FailedPreconditionError("scoring has been started already");
  }
  places_.Open(filled);
  queue_.Open();
  for (int k = 0; k < ThreadCount(); ++k) {
    threads_.emplace_back([this] { Run(); });
  }
  return absl::OkStatus();
}

void ScoringWorkers::Stop() {
  std::vector<std::thread> threads;
  {
    const std::lock_guard lock(mutex_);
    queue_.Close();
    places_.Close();
    threads.swap(threads_);
  }
  for (std::thread& thread : threads) {
    thread.join();
  }
}

absl::Status ScoringWorkers::TakePlace(const std::string& rig,
                                       const std::function<bool()>& cancelled) {
  return places_.Take(rig, cancelled);
}

void ScoringWorkers::FillPlace(const std::string& rig) {
  places_.Fill(rig);
  if (claims_->Find(rig)) {
    queue_.Wake();
  } else {
    claims_->Wake(rig);  // wakes the queue once it has the claim
  }
}

void ScoringWorkers::ReturnPlace(const std::string& rig) {
  places_.Return(rig);
}

void ScoringWorkers::Wake() {
  queue_.Wake();
  ReturnPlacesOfOthers();
}

void ScoringWorkers::ReturnPlacesOfOthers() {
  std::vector<std::string> rigs = places_.FilledRigs();
  std::erase_if(rigs, [this](const auto& rig) { return claims_->Find(rig); });
  for (const std::string& rig : rigs) {
    const auto unscored = store()->CountUnscored(rig);
    if (!unscored.ok()) return;  // the next call tries again
    places_.EmptyAllBut(rig, *unscored);
  }
}

absl::StatusOr<QuarantineCommit> ScoringWorkers::Quarantine(
    const std::string& rig,
    const std::function<absl::StatusOr<QuarantineCommit>()>& change) {
  const std::set<std::int64_t> claimed = queue_.BeginChange(rig);
  auto commit = change();
  int waiting = 0;
  if (commit.ok()) {
    // A worker that has claimed one returns its place itself.
    for (const std::int64_t sequence : commit->unscored_sequences) {
      if (!claimed.contains(sequence)) ++waiting;
    }
  }
  EndChange(rig, waiting);
  return commit;
}

absl::Status ScoringWorkers::Delete(
    const std::string& rig,
    const std::function<absl::StatusOr<int>()>& change) {
  queue_.BeginChange(rig);
  queue_.WaitForClaims(rig);
  const absl::StatusOr<int> waiting = change();
  EndChange(rig, waiting.ok() ? *waiting : 0);
  return waiting.status();
}

void ScoringWorkers::EndChange(const std::string& rig, int waiting) {
  places_.Empty(rig, waiting);
  queue_.EndChange(rig);
}

void ScoringWorkers::Run() {
  while (const std::optional<Claim> claim = queue_.Next()) {
    Process(*claim);
  }
}

void ScoringWorkers::Process(const Claim& claim) {
  const auto score = FindScore(claim);
  if (score && queue_.WaitForTurn(claim)) {
    Commit(claim, *score);
  }
  places_.Empty(claim.rig, 1);
  queue_.End(claim);
  on_done_(claim.rig);
}

std::optional<absl::StatusOr<ScoringWorkers::Score>> ScoringWorkers::FindScore(
    const Claim& claim) {
  absl::StatusOr<Score> score = absl::UnknownError("");
  const absl::Status status = Retry([&] {
    try {
      score = TryScore(claim);
    } catch (const std::exception& error) {
      score = absl::InternalError(
          fmt::format("scoring it failed: {}", error.what()));
    }
    return score.status();
  });
  if (IsTransient(status)) {
    return std::nullopt;
  }
  return score;
}

absl::StatusOr<ScoringWorkers::Score> ScoringWorkers::TryScore(
    const Claim& claim) {
  SELFCAL_ASSIGN_OR_RETURN(const StoredRig rig, store()->GetRig(claim.rig));
  SELFCAL_ASSIGN_OR_RETURN(const MotionSegment segment,
                           store()->GetSegmentData(claim.rig, claim.key));
  SELFCAL_ASSIGN_OR_RETURN(const StoredCalibration active,
                           store()->GetActiveCalibration(claim.rig));
  Score score{estimators_.score(rig.rig, active.theta, segment),
              std::nullopt,
              {active.version, PriorSigmas(rig.rig)}};
  if (estimators_.ends) {
    score.ends = estimators_.ends(rig.rig, active.theta, segment);
  }
  if (!IsFinite(score)) {
    return absl::InternalError("its information is not finite");
  }
  return score;
}

void ScoringWorkers::Commit(const Claim& claim,
                            const absl::StatusOr<Score>& score) {
  const absl::Status status =
      score.ok() ? Retry([&] { return TryCommit(claim, *score); })
                 : score.status();
  if (IsClaimLost(status)) {
    spdlog::info("{}: {}", Name(claim.rig, claim.key), status.ToString());
  } else if (!status.ok() && !IsTransient(status)) {
    Quarantine(claim, status);
  }
}

absl::Status ScoringWorkers::TryCommit(const Claim& claim, const Score& score) {
  SELFCAL_ASSIGN_OR_RETURN(
      const ScoreCommit commit,
      domain_->CommitScore(
          claim.of_rig, claim.key, score.information, score.ends));
  spdlog::info("{} is scored; tables: [{}]",
               Name(claim.rig, claim.key),
               fmt::join(commit.tables, ", "));
  if (commit.change) {
    spdlog::warn("rig {} has changed: [{}], from sequence {} on",
                 claim.rig,
                 fmt::join(commit.change->groups, ", "),
                 commit.change->first_sequence);
    on_change_(claim.rig);
  }
  if (commit.started_run) {
    on_run_(*commit.started_run);
  }
  if (commit.basis != score.basis) ScoreAgain(claim);
  return absl::OkStatus();
}

void ScoringWorkers::ScoreAgain(const Claim& claim) {
  constexpr int kMostActivations = 3;  // meanwhile
  absl::Status status;
  for (int i = 0; i < kMostActivations; ++i) {
    const auto score = FindScore(claim);
    if (!score) return;
    status = score->status();
    // Its data is gone if nothing needs it.
    if (absl::IsFailedPrecondition(status)) return;
    if (!status.ok()) break;
    if (!(*score)->ends) return;
    status = Retry([&] {
      return domain_->ReplaceScore(claim.of_rig,
                                   (*score)->basis,
                                   claim.key,
                                   (*score)->information,
                                   *(*score)->ends);
    });
    if (!absl::IsFailedPrecondition(status)) break;
  }
  if (status.ok()) return;
  spdlog::warn("{} keeps the score that it had before: {}",
               Name(claim.rig, claim.key),
               status.ToString());
}

void ScoringWorkers::Quarantine(const Claim& claim, const absl::Status& why) {
  const std::string problem(why.message());
  spdlog::error("{} is quarantined: {}", Name(claim.rig, claim.key), problem);
  Backoff backoff;
  for (;;) {
    const absl::Status status =
        domain_->MarkUnusable(claim.of_rig, claim.key, problem);
    if (status.ok() || absl::IsNotFound(status) || IsClaimLost(status)) {
      return;
    }
    spdlog::error("cannot quarantine {}: {}",
                  Name(claim.rig, claim.key),
                  status.ToString());
    if (!queue_.Pause(backoff.Next())) {
      return;
    }
  }
}

absl::Status ScoringWorkers::Retry(const std::function<absl::Status()>& call) {
  Backoff backoff;
  for (;;) {
    absl::Status status = call();
    if (!IsTransient(status)) {
      return status;
    }
    spdlog::warn("scoring waits: {}", status.ToString());
    if (!queue_.Pause(backoff.Next())) {
      return status;
    }
  }
}

}  // namespace selfcal::server
