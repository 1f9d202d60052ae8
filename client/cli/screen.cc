#include "client/cli/screen.h"

#include <fcntl.h>
#include <poll.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <stdexcept>

namespace selfcal::client {
namespace {

constexpr char kEnter[] = "\033[?1049h\033[?25l";  // the alternate screen
constexpr char kLeave[] = "\033[?25h\033[?1049l";
constexpr char kHome[] = "\033[H";
constexpr char kEraseLine[] = "\033[K";
constexpr char kEraseBelow[] = "\033[J";

// The signal handler, which may run on any thread, writes to this pipe; Wait
// reads from it.
int signal_pipe[2] = {-1, -1};

void OnSignal(int signal) {
  const int error = errno;
  const char byte = signal == SIGWINCH ? 'w' : 'q';
  // If the pipe is full, nothing is lost: the reader wakes up anyway.
  [[maybe_unused]] const auto written = write(signal_pipe[1], &byte, 1);
  errno = error;
}

}  // namespace

Screen::Screen() {
  if (pipe2(signal_pipe, O_CLOEXEC | O_NONBLOCK) != 0) {
    throw std::runtime_error("cannot create a pipe for signals");
  }
  struct sigaction action {};
  action.sa_handler = OnSignal;
  for (std::size_t i = 0; i < kSignals.size(); ++i) {
    sigaction(kSignals[i], &action, &before_[i]);
  }
  std::fputs(kEnter, stdout);
  std::fflush(stdout);
}

Screen::~Screen() {
  std::fputs(kLeave, stdout);
  std::fflush(stdout);
  for (std::size_t i = 0; i < kSignals.size(); ++i) {
    sigaction(kSignals[i], &before_[i], nullptr);
  }
  close(signal_pipe[0]);
  close(signal_pipe[1]);
}

bool Screen::Show(const std::string& lines) {
  std::string out = kHome;
  for (const char c : lines) {
    if (c == '\n') out += kEraseLine;
    out += c;
  }
  out += kEraseLine;
  out += kEraseBelow;
  std::fputs(out.c_str(), stdout);
  return std::fflush(stdout) == 0;
}

bool Screen::Wait(std::chrono::milliseconds time) {
  pollfd signals{signal_pipe[0], POLLIN, 0};
  poll(&signals, 1, static_cast<int>(time.count()));
  for (char byte = 0; read(signal_pipe[0], &byte, 1) == 1;) {
    if (byte == 'q') return false;
  }
  return true;
}

}  // namespace selfcal::client
