// A real selfcald on a folder of its own, for the tests of the whole system.
#pragma once

#include <absl/status/status.h>

#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "client/demo/daemon_process.h"
#include "client/demo/daemon_view.h"

namespace selfcal::client {

// A folder that is removed at the end, with a state folder inside. Destroy the
// daemon before it.
class ScratchFolder {
 public:
  ScratchFolder();
  ~ScratchFolder();
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;

  const std::string& state_dir() const { return state_dir_; }
  std::string target() const;  // of a daemon on it, as gRPC names it

  // Starts the daemon that the build made; ends the process if it cannot, for
  // then there is nothing to test.
  std::unique_ptr<DaemonProcess> StartDaemon() const;

 private:
  std::filesystem::path root_;
  std::string state_dir_;
};

// Waits until `segments` are scored and no run is unfinished.
absl::Status WaitUntilIdle(DaemonView& view,
                           std::size_t segments,
                           std::chrono::seconds limit);

// "recorded~3" of "rigs/r/segments/recorded~3".
std::string LastPart(const std::string& name);

// The score of a group, or null.
const v1::GroupScore* FindScore(const v1::Segment& segment,
                                const std::string& group);

}  // namespace selfcal::client
