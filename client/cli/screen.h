// The terminal as a full screen, for a command that redraws it until Ctrl-C.
#pragma once

#include <array>
#include <chrono>
#include <csignal>
#include <string>

namespace selfcal::client {

// Only one may exist at a time. Not thread-safe.
class Screen {
 public:
  // Shows an empty screen without a cursor.
  Screen();
  // Restores the terminal and the signal handlers.
  ~Screen();
  Screen(const Screen&) = delete;
  Screen& operator=(const Screen&) = delete;

  // Replaces the content of the screen. Returns false if writing fails.
  bool Show(const std::string& lines);

  // Waits for this time, or until the size of the terminal changes. Returns
  // false once SIGINT, SIGTERM or SIGHUP has arrived.
  bool Wait(std::chrono::milliseconds time);

 private:
  static constexpr std::array kSignals = {SIGINT, SIGTERM, SIGHUP, SIGWINCH};
  std::array<struct sigaction, kSignals.size()> before_{};
};

}  // namespace selfcal::client
