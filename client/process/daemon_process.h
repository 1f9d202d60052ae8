// selfcald as a child process, for programs that need a daemon of their own. It
// ends with the program: also when that is killed, and not by a signal from the
// terminal, which only the program gets.
#pragma once

#include <absl/status/statusor.h>
#include <sys/types.h>

#include <memory>
#include <string>

namespace selfcal::client {

class DaemonProcess {
 public:
  // Starts `binary` on `state_dir` (its output is appended to `state_dir`.log)
  // and waits until it serves. NOT_FOUND without the binary, UNAVAILABLE with
  // the end of the log if it does not serve.
  static absl::StatusOr<std::unique_ptr<DaemonProcess>> Start(
      const std::string& binary, const std::string& state_dir);
  ~DaemonProcess();  // sends SIGTERM and waits for the end
  DaemonProcess(const DaemonProcess&) = delete;
  DaemonProcess& operator=(const DaemonProcess&) = delete;

  // Sends SIGKILL and waits for the end.
  void Kill();

  // The address, in the syntax of gRPC.
  const std::string& target() const { return target_; }
  pid_t pid() const { return pid_; }

 private:
  DaemonProcess(pid_t pid, std::string target);

  pid_t pid_;
  const std::string target_;
};

}  // namespace selfcal::client
