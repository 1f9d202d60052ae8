#include "test/system/running_daemon.h"

#include <gtest/gtest.h>
#include <stdlib.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <thread>

#include "test/support/eventually.h"

namespace selfcal::client {
namespace {

bool HasEnded(const v1::Recalibration& run) {
  return run.state() != v1::Recalibration::PENDING &&
         run.state() != v1::Recalibration::RUNNING;
}

// Errors of a connection are waited out: the daemon may be starting.
bool IsIdle(DaemonView& view, std::size_t segments) {
  const auto state = view.GetState();
  if (!state.ok() || state->segments.size() != segments) return false;
  for (const v1::Segment& segment : state->segments) {
    if (segment.state() == v1::Segment::STORED) return false;
  }
  // The last score and the run that it triggers are one transaction.
  const auto runs = view.GetRuns();
  if (!runs.ok()) return false;
  for (const v1::Recalibration& run : *runs) {
    if (!HasEnded(run)) return false;
  }
  return true;
}

}  // namespace

std::string ScratchFolder::target() const {
  return "unix:" + state_dir_ + "/selfcald.sock";
}

std::unique_ptr<DaemonProcess> ScratchFolder::StartDaemon() const {
  auto daemon = DaemonProcess::Start(SELFCAL_DAEMON, state_dir_);
  if (!daemon.ok()) {
    std::fprintf(stderr, "%s\n", daemon.status().ToString().c_str());
    std::abort();
  }
  return *std::move(daemon);
}

absl::Status WaitUntilIdle(DaemonView& view,
                           std::size_t segments,
                           std::chrono::seconds limit) {
  if (Eventually(
          [&] { return IsIdle(view, segments); }, limit, kDaemonInterval)) {
    return absl::OkStatus();
  }
  return absl::DeadlineExceededError("not all is scored and calibrated");
}

std::string LastPart(const std::string& name) {
  return name.substr(name.rfind('/') + 1);
}

const v1::GroupScore* FindScore(const v1::Segment& segment,
                                const std::string& group) {
  for (const v1::GroupScore& score : segment.scores()) {
    if (score.group() == group) return &score;
  }
  return nullptr;
}

}  // namespace selfcal::client
