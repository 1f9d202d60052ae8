#include "server/console/outbox.h"

#include <algorithm>
#include <utility>

namespace selfcal::server {
namespace {

constexpr std::size_t kMaxLines = 256;

}  // namespace

void Outbox::Put(std::string line) {
  {
    const std::lock_guard lock(mutex_);
    if (closed_) return;
    if (std::find(lines_.begin(), lines_.end(), line) != lines_.end()) return;
    if (lines_.size() >= kMaxLines) {
      lines_.clear();
      line = overflow_;
    }
    lines_.push_back(std::move(line));
  }
  arrived_.notify_one();
}

void Outbox::Close() {
  {
    const std::lock_guard lock(mutex_);
    closed_ = true;
  }
  arrived_.notify_one();
}

std::optional<std::string> Outbox::Take(std::chrono::milliseconds timeout) {
  std::unique_lock lock(mutex_);
  arrived_.wait_for(
      lock, timeout, [this] { return closed_ || !lines_.empty(); });
  if (lines_.empty() && closed_) return std::nullopt;
  std::string together;
  for (const std::string& line : lines_) together += line;
  lines_.clear();
  return together;
}

}  // namespace selfcal::server
