#include "server/pipeline/verification_sampler.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <exception>
#include <utility>

#include "core/information/landmark_sketch.h"
#include "server/status/status_macros.h"

namespace selfcal::server {

bool IsSampled(std::string_view name, double share) {
  if (share <= 0) return false;
  // FNV-1a, whose high bits the finaliser mixes.
  std::uint64_t hash = 0xcbf29ce484222325;
  for (const char c : name) {
    hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3;
  }
  constexpr double kHashes = 18446744073709551616.0;  // 2^64
  return static_cast<double>(LandmarkHash(hash)) < share * kHashes ||
         share >= 1;
}

VerificationSampler::VerificationSampler(Store* store,
                                         const PipelineOptions& options,
                                         Verifier* verifier)
    : store_(store), options_(options), verifier_(verifier) {}

VerificationSampler::~VerificationSampler() { Stop(); }

void VerificationSampler::Start() {
  const std::lock_guard lock(mutex_);
  if (running_ || options_.verify_share <= 0) return;
  running_ = true;
  thread_ = std::thread([this] { Loop(); });
}

void VerificationSampler::Stop() {
  std::thread thread;
  {
    const std::lock_guard lock(mutex_);
    running_ = false;
    thread.swap(thread_);
  }
  changed_.notify_all();
  if (thread.joinable()) {
    thread.join();
  }
}

void VerificationSampler::OnScore(const Rig& rig,
                                  const MotionSegment& segment,
                                  const SegmentInformation& information) {
  if (options_.verify_share <= 0) return;
  const std::string name = fmt::format(
      "{}/segments/{}~{}", rig.id, segment.key.session, segment.key.index);
  if (IsSampled(name, options_.verify_share)) {
    Put(ScoredSegment{rig, segment, information});
  }
}

void VerificationSampler::OnRun(const StoredRun& run) {
  const std::string name =
      fmt::format("{}/recalibrations/{}", run.rig, run.run);
  if (run.state == RunState::kSucceeded &&
      IsSampled(name, options_.verify_share)) {
    Put(run);
  }
}

void VerificationSampler::Put(Item item) {
  {
    const std::lock_guard lock(mutex_);
    if (!running_ || waiting_.size() >= kMaxWaiting) return;
    waiting_.push_back(std::move(item));
  }
  changed_.notify_all();
}

void VerificationSampler::Loop() {
  for (;;) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return !running_ || !waiting_.empty(); });
    if (!running_) return;
    lock.unlock();
    if (!WaitUntilIdle()) return;
    lock.lock();
    const Item item = std::move(waiting_.front());
    waiting_.pop_front();
    lock.unlock();
    const absl::Status status = Check(item);
    if (!status.ok() && !absl::IsCancelled(status)) {
      spdlog::warn("a check did not take place: {}", status.ToString());
    }
  }
}

bool VerificationSampler::WaitUntilIdle() {
  std::unique_lock lock(mutex_);
  while (running_ && options_.conditions != nullptr &&
         !options_.conditions->DeferReason().empty()) {
    changed_.wait_for(lock, options_.recheck, [this] { return !running_; });
  }
  return running_;
}

absl::Status VerificationSampler::Check(const Item& item) {
  try {
    const auto* scored = std::get_if<ScoredSegment>(&item);
    return scored != nullptr ? CheckScore(*scored)
                             : CheckRun(std::get<StoredRun>(item));
  } catch (const std::exception& error) {
    return absl::InternalError(error.what());
  }
}

absl::Status VerificationSampler::CheckScore(const ScoredSegment& scored) {
  SELFCAL_ASSIGN_OR_RETURN(
      ScoreCheck check,
      verifier_->CheckScore(
          scored.rig, scored.segment, scored.information, nullptr));
  SELFCAL_ASSIGN_OR_RETURN(const StoredCalibration active,
                           store_->GetActiveCalibration(scored.rig.id));
  return verifier_->Conclude(scored.rig.id,
                             {active.version, {std::move(check)}, {}});
}

absl::Status VerificationSampler::CheckRun(const StoredRun& run) {
  SELFCAL_ASSIGN_OR_RETURN(
      CalibrationCheck check,
      verifier_->CheckCalibration(run.rig, run.calibration_version, nullptr));
  return verifier_->Conclude(run.rig,
                             {run.calibration_version, {}, std::move(check)});
}

}  // namespace selfcal::server
