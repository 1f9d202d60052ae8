// A pipeline that stores without scoring, and whose publications, progress and
// errors are those that a test asks for.
#pragma once

#include <functional>
#include <list>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "server/domain/domain.h"
#include "server/pipeline/pipeline.h"

namespace selfcal::server {

class FakePipeline final : public Pipeline {
 public:
  explicit FakePipeline(Domain* domain)
      : domain_(domain), store_(domain->store()), coach_(store_) {}

  absl::Status Start() override { return absl::OkStatus(); }
  void Stop() override {}

  void ListenForDeletions(std::function<void(const std::string&)>) override {}

  // Replaces what Submit does after validation.
  std::function<absl::StatusOr<SubmitResult>(const std::function<bool()>&)>
      submit_hook;

  absl::StatusOr<SubmitResult> Submit(
      const std::string& rig,
      const MotionSegment& segment,
      const std::function<bool()>& cancelled) override {
    if (submit_hook) return submit_hook(cancelled);
    const auto stored = store_->GetRig(rig);
    if (!stored.ok()) return stored.status();
    auto violations = Validate(segment, stored->rig.factory);
    if (!violations.empty()) {
      return SubmitResult{SubmitResult::Verdict::kRejected, violations};
    }
    const auto put = domain_->PutSegment(rig, segment);
    if (!put.ok()) return put.status();
    return SubmitResult{*put == PutVerdict::kStored
                            ? SubmitResult::Verdict::kStored
                            : SubmitResult::Verdict::kDuplicate,
                        {}};
  }

  // Of every run, when a watch of it begins.
  CalibrateProgress progress;

  // Replaces BeginSubmit: whoever takes `done` answers when it likes.
  std::function<void(const MotionSegment&, const SubmitDone& done)> begin_hook;

  void BeginSubmit(const std::string& rig,
                   const MotionSegment& segment,
                   const std::function<bool()>& cancelled,
                   const SubmitDone& done) override {
    if (begin_hook) return begin_hook(segment, done);
    done(Submit(rig, segment, cancelled));
  }

  // Rigs whose sessions were ended, in that order.
  std::vector<std::string> ended() {
    const std::lock_guard lock(mutex_);
    return ended_;
  }

  void EndSession(const std::string& rig) override {
    const std::lock_guard lock(mutex_);
    ended_.push_back(rig);
  }

  absl::StatusOr<StoredRig> UpdateRig(const std::string& rig,
                                      const RigChange& change,
                                      const std::string& caller,
                                      const std::string& reason) override {
    auto update = domain_->UpdateRig(rig, change, caller, reason);
    if (!update.ok()) return update.status();
    return std::move(update->rig);
  }

  absl::Status DeleteRig(const std::string& rig,
                         const std::string& caller,
                         const std::string& reason) override {
    return domain_->DeleteRig(rig, caller, reason).status();
  }

  absl::Status DeleteSegment(const std::string& rig,
                             const SegmentKey& key,
                             const std::string& caller,
                             const std::string& reason) override {
    return domain_->DeleteSegment(rig, key, caller, reason).status();
  }

  absl::StatusOr<QuarantineCommit> QuarantineSegments(
      const std::string& rig,
      const std::string& session,
      std::optional<std::int64_t> index,
      const std::string& caller,
      const std::string& reason) override {
    return domain_->QuarantineSegments(rig, session, index, caller, reason);
  }

  using Pipeline::StartRecalibration;
  absl::StatusOr<StoredRun> StartRecalibration(const std::string& rig,
                                               bool force) override {
    return domain_->CreateManualRun(rig, force);
  }

  absl::StatusOr<StoredRun> CancelRecalibration(const std::string& rig,
                                                std::int64_t run) override {
    auto ended = domain_->EndRun(rig, run, RunState::kCancelled, "by hand");
    if (ended.ok()) Tell({*ended, {}});
    return ended;
  }

  absl::StatusOr<StoredCalibration> ActivateCalibration(
      const std::string& rig,
      std::int64_t version,
      const std::string& caller,
      const std::string& reason) override {
    auto active = domain_->ActivateCalibration(rig, version, caller, reason);
    if (active.ok()) Publish(*active);
    return active;
  }

  absl::StatusOr<ReportAnswer> TakeReport(const DeviceReport& report) override {
    return domain_->TakeReport(report);
  }

  absl::StatusOr<RigCoaching> AdviseMotion(const std::string& rig) override {
    return coach_.Advise(rig);
  }

  // Replaces VerifyRig.
  std::function<absl::StatusOr<Verification>(const OnVerificationStep&,
                                             const std::function<bool()>&)>
      verify_hook;

  absl::StatusOr<Verification> VerifyRig(
      const std::string& rig,
      const OnVerificationStep& on_step,
      const std::function<bool()>& interrupted) override {
    const auto stored = store_->GetRig(rig);
    if (!stored.ok()) return stored.status();
    return verify_hook ? verify_hook(on_step, interrupted) : Verification();
  }

  absl::StatusOr<std::unique_ptr<Subscription>> WatchCalibration(
      const std::string& rig,
      std::function<void(const std::shared_ptr<const StoredCalibration>&)>
          callback) override {
    const std::lock_guard lock(mutex_);
    auto active = store_->GetActiveCalibration(rig);
    if (!active.ok()) return active.status();
    callback(std::make_shared<const StoredCalibration>(*std::move(active)));
    return Subscribe(&calibration_watchers_, std::move(callback));
  }

  absl::StatusOr<std::unique_ptr<Subscription>> WatchRun(
      const std::string& rig,
      std::int64_t run,
      std::function<void(const RunUpdate&)> callback) override {
    const std::lock_guard lock(mutex_);
    const auto stored = store_->GetRun(rig, run);
    if (!stored.ok()) return stored.status();
    callback({*stored, progress});
    return Subscribe(&run_watchers_, std::move(callback));
  }

  void Publish(const StoredCalibration& calibration) {
    const auto shared = std::make_shared<const StoredCalibration>(calibration);
    const std::lock_guard lock(mutex_);
    for (const auto& watcher : calibration_watchers_) watcher(shared);
  }

  void Tell(const RunUpdate& update) {
    const std::lock_guard lock(mutex_);
    for (const auto& watcher : run_watchers_) watcher(update);
  }

  std::size_t watchers() {
    const std::lock_guard lock(mutex_);
    return calibration_watchers_.size() + run_watchers_.size();
  }

 private:
  template <typename T>
  using Watchers = std::list<std::function<void(const T&)>>;

  template <typename T>
  class Registration final : public Subscription {
   public:
    Registration(std::mutex* mutex,
                 Watchers<T>* watchers,
                 typename Watchers<T>::iterator place)
        : mutex_(mutex), watchers_(watchers), place_(place) {}
    ~Registration() override {
      const std::lock_guard lock(*mutex_);
      watchers_->erase(place_);
    }

   private:
    std::mutex* mutex_;
    Watchers<T>* watchers_;
    typename Watchers<T>::iterator place_;
  };

  // With the mutex held.
  template <typename T>
  std::unique_ptr<Subscription> Subscribe(
      Watchers<T>* watchers, std::function<void(const T&)> callback) {
    watchers->push_back(std::move(callback));
    return std::make_unique<Registration<T>>(
        &mutex_, watchers, std::prev(watchers->end()));
  }

  Domain* domain_;
  Store* store_;
  RigCoach coach_;
  std::mutex mutex_;
  Watchers<std::shared_ptr<const StoredCalibration>> calibration_watchers_;
  Watchers<RunUpdate> run_watchers_;
  std::vector<std::string> ended_;
};

}  // namespace selfcal::server
