#include "client/cli/progress.h"

#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <utility>

namespace selfcal::client {
namespace {

constexpr std::size_t kBar = 30;
constexpr std::size_t kDefaultWidth = 80;

std::size_t TerminalWidth() {
  winsize size{};
  if (ioctl(STDERR_FILENO, TIOCGWINSZ, &size) != 0 || size.ws_col == 0) {
    return kDefaultWidth;
  }
  return size.ws_col;
}

}  // namespace

std::string ProgressLine(std::string_view label,
                         std::size_t done,
                         std::size_t total,
                         std::string_view note,
                         std::size_t width) {
  done = std::min(done, total);
  const std::size_t filled = total == 0 ? 0 : kBar * done / total;
  std::string line = fmt::format("{} [{}{}] {}/{}",
                                 label,
                                 std::string(filled, '#'),
                                 std::string(kBar - filled, '-'),
                                 done,
                                 total);
  if (!note.empty()) line += fmt::format(" {}", note);
  // A line that wraps could not be removed again.
  if (line.size() >= width) line.resize(width == 0 ? 0 : width - 1);
  return line;
}

Progress::Progress(std::string label)
    : label_(std::move(label)), terminal_(isatty(STDERR_FILENO) == 1) {}

Progress::~Progress() { Clear(); }

void Progress::Show(std::size_t done,
                    std::size_t total,
                    std::string_view note) {
  if (!terminal_) return;
  Put(ProgressLine(label_, done, total, note, TerminalWidth()));
}

void Progress::Say(std::string_view note) {
  if (!terminal_) return;
  std::string line = fmt::format("{}: {}", label_, note);
  line.resize(std::min(line.size(), TerminalWidth() - 1));
  Put(line);
}

void Progress::Put(const std::string& line) {
  std::fprintf(stderr, "\r\033[K%s", line.c_str());
  std::fflush(stderr);
  shown_ = true;
}

void Progress::Clear() {
  if (!shown_) return;
  std::fputs("\r\033[K", stderr);
  std::fflush(stderr);
  shown_ = false;
}

}  // namespace selfcal::client
