#include "server/access/tls_reload.h"

#include <chrono>
#include <utility>

namespace selfcal::server {

absl::StatusOr<std::unique_ptr<TlsReload>> TlsReload::Start(
    const TlsOptions& options,
    std::function<std::int64_t()> now_s,
    Report report) {
  auto files = ReadTlsFiles(options, now_s());
  if (!files.ok()) return files.status();
  std::unique_ptr<TlsReload> reload(new TlsReload(
      options, std::move(now_s), std::move(report), *std::move(files)));
  reload->thread_ = std::thread([raw = reload.get()] { raw->Run(); });
  return reload;
}

TlsReload::TlsReload(const TlsOptions& options,
                     std::function<std::int64_t()> now_s,
                     Report report,
                     TlsFiles files)
    : options_(options),
      now_s_(std::move(now_s)),
      report_(std::move(report)),
      current_(std::make_shared<const TlsFiles>(std::move(files))) {}

TlsReload::~TlsReload() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

std::shared_ptr<const TlsFiles> TlsReload::Current() const {
  const std::lock_guard lock(mutex_);
  return current_;
}

std::string TlsReload::Problem() const {
  const std::lock_guard lock(mutex_);
  return problem_;
}

void TlsReload::Run() {
  std::unique_lock lock(mutex_);
  while (!changed_.wait_for(lock,
                            std::chrono::seconds(options_.refresh_s),
                            [this] { return stopping_; })) {
    lock.unlock();
    Look();
    lock.lock();
  }
}

void TlsReload::Look() {
  auto files = ReadTlsFiles(options_, now_s_());
  const std::string problem(files.status().message());
  bool is_new = false;
  {
    const std::lock_guard lock(mutex_);
    is_new = files.ok() ? *files != *current_ : problem != problem_;
    problem_ = problem;
    if (files.ok() && is_new) {
      current_ = std::make_shared<const TlsFiles>(*std::move(files));
    }
  }
  // Once for each change: the files may stay as they are for days.
  if (is_new) report_(problem.empty(), problem);
}

}  // namespace selfcal::server
