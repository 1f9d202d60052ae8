// A real selfcald on a folder of its own, for the tests of the whole system.
#pragma once

#include <absl/status/status.h>

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "client/demo/daemon_view.h"
#include "client/process/daemon_process.h"
#include "test/support/temp_folder.h"

namespace selfcal::client {

// A folder that is removed at the end, with a state folder inside. Destroy the
// daemon before it.
class ScratchFolder {
 public:
  const std::string& state_dir() const { return state_dir_; }
  std::string target() const;  // of a daemon on it, as gRPC names it

  // Starts the daemon that the build made; ends the process if it cannot, for
  // then there is nothing to test.
  std::unique_ptr<DaemonProcess> StartDaemon() const;

 private:
  const TempFolder folder_;
  const std::string state_dir_ = folder_.File("state");
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
