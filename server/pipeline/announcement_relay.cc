#include "server/pipeline/announcement_relay.h"

namespace selfcal::server {

void AnnouncementRelay::Start() {
  listener_ = store_->Listen(
      [this](const Announcement& announcement) { Act(announcement); });
}

void AnnouncementRelay::Act(const Announcement& announcement) {
  switch (announcement.kind) {
    case Announcement::Kind::kCalibration:
      PassOnActive(announcement.rig);
      break;
    case Announcement::Kind::kRun:
      OnRun(announcement.rig, announcement.run);
      break;
    case Announcement::Kind::kDeletion:
      OnDeletion(announcement.rig);
      break;
    case Announcement::Kind::kMissed:
      OnDeletion("");
      for (const auto& rig : calibration_watchers_->Topics()) {
        PassOnActive(rig);
      }
      for (const auto& [rig, run] : run_watchers_->Topics()) OnRun(rig, run);
      break;
  }
}

void AnnouncementRelay::PassOnRig(const std::string& rig) {
  OnDeletion(rig);
  PassOnActive(rig);
  for (const auto& [of, run] : run_watchers_->Topics()) {
    if (of == rig) OnRun(rig, run);
  }
}

void AnnouncementRelay::OnDeletion(const std::string& rig) {
  std::function<void(const std::string&)> deleted;
  {
    const std::lock_guard lock(mutex_);
    deleted = deleted_;
  }
  if (deleted) deleted(rig);
}

// Should the store fail in one of the following, the listener reports soon that
// announcements may have been missed.

void AnnouncementRelay::PassOnActive(const std::string& rig) {
  if (!calibration_watchers_->IsWatched(rig)) return;
  auto active = store_->GetActiveCalibration(rig);
  if (active.ok()) calibration_watchers_->PassOn(*std::move(active));
}

void AnnouncementRelay::OnRun(const std::string& rig, std::int64_t number) {
  const bool is_own = claims_->Find(rig).has_value();
  if (!is_own && !run_watchers_->IsWatched({rig, number})) return;
  const auto run = store_->GetRun(rig, number);
  if (!run.ok()) return;
  if (run->end_time_ns != 0) recalibrator_->Interrupt(rig, number);
  if (is_own) recalibrator_->Wake();
  run_watchers_->PassOn(RunUpdate{*run});
}

}  // namespace selfcal::server
