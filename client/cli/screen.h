// The whole terminal for a command that draws again and again, until Ctrl-C.
#pragma once

#include <array>
#include <chrono>
#include <csignal>
#include <string>

namespace selfcal::client {

// One at a time. Not thread-safe.
class Screen {
 public:
  // Shows an empty screen without a cursor.
  Screen();
  // The terminal is as it was, and signals do what they did.
  ~Screen();
  Screen(const Screen&) = delete;
  Screen& operator=(const Screen&) = delete;

  // Of the terminal now; 80 x 24 where it does not say.
  struct Size {
    int columns = 80;
    int rows = 24;
  };
  Size size() const;

  // In place of what it showed. False if it cannot be written.
  bool Show(const std::string& lines);

  // Returns early when the terminal gets another size; false once SIGINT,
  // SIGTERM or SIGHUP has come.
  bool Wait(std::chrono::milliseconds time);

 private:
  static constexpr std::array kSignals = {SIGINT, SIGTERM, SIGHUP, SIGWINCH};
  std::array<struct sigaction, kSignals.size()> before_{};
};

}  // namespace selfcal::client
