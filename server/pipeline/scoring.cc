#include "server/pipeline/scoring.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <exception>
#include <limits>

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
      store_(domain->store()),
      claims_(claims),
      options_(options),
      estimators_(std::move(estimators)),
      on_run_(std::move(on_run)),
      on_change_(std::move(on_change)),
      on_done_(std::move(on_done)),
      backlog_(options.max_backlog) {}

ScoringWorkers::~ScoringWorkers() { Stop(); }

absl::Status ScoringWorkers::Start() {
  // Each of several daemons counts what it has received itself.
  std::vector<Store::Unscored> left;
  if (!options_.replica.shared) {
    SELFCAL_ASSIGN_OR_RETURN(
        left, store_->ListUnscored(std::numeric_limits<int>::max()));
  }
  const std::lock_guard lock(mutex_);
  if (running_) {
    return absl::FailedPreconditionError("scoring has been started already");
  }
  running_ = true;
  std::map<std::string, int> taken;
  for (const Store::Unscored& segment : left) {
    ++taken[segment.rig];
    ++filled_[segment.rig];
  }
  backlog_.Open(std::move(taken));
  for (int k = 0; k < std::max(1, options_.scoring_threads); ++k) {
    threads_.emplace_back([this] { Run(); });
  }
  return absl::OkStatus();
}

void ScoringWorkers::Stop() {
  std::vector<std::thread> threads;
  {
    const std::lock_guard lock(mutex_);
    running_ = false;
    threads.swap(threads_);
  }
  backlog_.Close();
  changed_.notify_all();
  for (std::thread& thread : threads) {
    thread.join();
  }
}

absl::Status ScoringWorkers::TakePlace(const std::string& rig,
                                       const std::function<bool()>& cancelled) {
  return backlog_.Take(rig, cancelled);
}

void ScoringWorkers::FillPlace(const std::string& rig) {
  {
    const std::lock_guard lock(mutex_);
    ++filled_[rig];
    ++arrivals_;
  }
  changed_.notify_all();
  if (!claims_->Find(rig)) claims_->Wake();
}

void ScoringWorkers::Wake() {
  {
    const std::lock_guard lock(mutex_);
    ++arrivals_;
  }
  changed_.notify_all();
  ReturnPlacesOfOthers();
}

void ScoringWorkers::ReturnPlacesOfOthers() {
  std::vector<std::string> rigs;
  {
    const std::lock_guard lock(mutex_);
    for (const auto& [rig, places] : filled_) {
      if (!claims_->Find(rig)) rigs.push_back(rig);
    }
  }
  for (const std::string& rig : rigs) {
    const auto unscored = store_->CountUnscored(rig);
    if (!unscored.ok()) return;  // the next call tries again
    const std::lock_guard lock(mutex_);
    const auto filled = filled_.find(rig);
    if (filled == filled_.end()) continue;
    const std::int64_t scored =
        std::max<std::int64_t>(0, filled->second - *unscored);
    backlog_.Return(rig, static_cast<int>(scored));
    filled->second -= scored;
    if (filled->second == 0) filled_.erase(filled);
  }
}

void ScoringWorkers::EmptyPlaces(const std::string& rig, int places) {
  backlog_.Return(rig, places);
  const auto filled = filled_.find(rig);
  if (filled == filled_.end()) return;
  filled->second -= places;
  if (filled->second <= 0) filled_.erase(filled);
}

void ScoringWorkers::ReturnPlace(const std::string& rig) {
  backlog_.Return(rig);
}

absl::StatusOr<QuarantineCommit> ScoringWorkers::Quarantine(
    const std::string& rig,
    const std::function<absl::StatusOr<QuarantineCommit>()>& change) {
  decltype(claimed_) claimed;
  {
    const std::lock_guard lock(mutex_);
    changing_.insert(rig);
    claimed = claimed_;
  }
  auto commit = change();
  int waiting = 0;
  if (commit.ok()) {
    // A worker that has claimed one returns its place itself.
    for (const std::int64_t sequence : commit->unscored_sequences) {
      if (!claimed.contains({rig, sequence})) ++waiting;
    }
  }
  EndChange(rig, waiting);
  return commit;
}

absl::Status ScoringWorkers::Delete(
    const std::string& rig,
    const std::function<absl::StatusOr<int>()>& change) {
  {
    std::unique_lock lock(mutex_);
    changing_.insert(rig);
    changed_.wait(lock, [&] {
      const auto first =
          claimed_.lower_bound({rig, std::numeric_limits<std::int64_t>::min()});
      return first == claimed_.end() || first->first.first != rig;
    });
  }
  const absl::StatusOr<int> waiting = change();
  EndChange(rig, waiting.ok() ? *waiting : 0);
  return waiting.status();
}

void ScoringWorkers::EndChange(const std::string& rig, int waiting) {
  {
    const std::lock_guard lock(mutex_);
    EmptyPlaces(rig, waiting);
    changing_.erase(changing_.find(rig));
    ++arrivals_;  // what was passed over meanwhile is looked at again
  }
  changed_.notify_all();
}

void ScoringWorkers::Run() {
  while (const std::optional<Claim> claim = NextClaim()) {
    Process(*claim);
  }
}

std::optional<ScoringWorkers::Claim> ScoringWorkers::NextClaim() {
  Backoff backoff;
  std::unique_lock lock(mutex_);
  while (running_) {
    // Under the lock, a segment is either in the list, or its FillPlace is
    // still to come and wakes this thread.
    const std::int64_t seen = arrivals_;
    const auto unscored = store_->ListUnscored(std::numeric_limits<int>::max(),
                                               claims_->replica());
    if (!unscored.ok()) {
      spdlog::error("cannot list what to score: {}",
                    unscored.status().ToString());
      changed_.wait_for(lock, backoff.Next(), [this] { return !running_; });
      continue;
    }
    if (std::optional<Claim> next = Choose(*unscored)) {
      claimed_.emplace(std::pair(next->rig, next->sequence), next->of_rig);
      return next;
    }
    changed_.wait(lock, [&] { return !running_ || arrivals_ != seen; });
  }
  return std::nullopt;
}

std::optional<ScoringWorkers::Claim> ScoringWorkers::Choose(
    const std::vector<Store::Unscored>& unscored) {
  std::vector<Claim> claims;
  std::vector<FairOrder::Piece> pieces;
  for (const Store::Unscored& candidate : unscored) {
    // A rig's next is the oldest that nobody scores.
    if ((!claims.empty() && claims.back().rig == candidate.rig) ||
        changing_.contains(candidate.rig) ||
        claimed_.contains({candidate.rig, candidate.sequence})) {
      continue;
    }
    const std::optional<RigClaim> rig = claims_->Find(candidate.rig);
    if (!rig || IsScoredUnderAnother(*rig)) continue;
    claims.push_back({candidate.rig, *rig, candidate.key, candidate.sequence});
    // The time of a score grows with the number of readings.
    pieces.push_back({candidate.rig, static_cast<double>(candidate.readings)});
  }
  const std::optional<std::size_t> next = order_.Take(pieces);
  if (!next) return std::nullopt;
  return claims[*next];
}

// The score of the older segment would be refused, and computed once more after
// that of this one.
bool ScoringWorkers::IsScoredUnderAnother(const RigClaim& claim) const {
  for (auto scored = claimed_.lower_bound(
           {claim.rig, std::numeric_limits<std::int64_t>::min()});
       scored != claimed_.end() && scored->first.first == claim.rig;
       ++scored) {
    if (scored->second != claim) return true;
  }
  return false;
}

void ScoringWorkers::Process(const Claim& claim) {
  const auto score = FindScore(claim);
  if (score && WaitForTurn(claim)) {
    Commit(claim, *score);
  }
  {
    const std::lock_guard lock(mutex_);
    claimed_.erase({claim.rig, claim.sequence});
    EmptyPlaces(claim.rig, 1);
  }
  changed_.notify_all();
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
  SELFCAL_ASSIGN_OR_RETURN(const StoredRig rig, store_->GetRig(claim.rig));
  SELFCAL_ASSIGN_OR_RETURN(const MotionSegment segment,
                           store_->GetSegmentData(claim.rig, claim.key));
  SELFCAL_ASSIGN_OR_RETURN(const StoredCalibration active,
                           store_->GetActiveCalibration(claim.rig));
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

bool ScoringWorkers::WaitForTurn(const Claim& claim) {
  std::unique_lock lock(mutex_);
  const auto is_oldest = [&] {
    const auto oldest = claimed_.lower_bound({claim.rig, 0});
    return oldest->first.second == claim.sequence;
  };
  changed_.wait(lock, [&] { return !running_ || is_oldest(); });
  return is_oldest();
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
                                   (*score)->basis.active,
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
    if (!Pause(backoff.Next())) {
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
    if (!Pause(backoff.Next())) {
      return status;
    }
  }
}

bool ScoringWorkers::Pause(std::chrono::milliseconds time) {
  std::unique_lock lock(mutex_);
  changed_.wait_for(lock, time, [this] { return !running_; });
  return running_;
}

}  // namespace selfcal::server
