// The TLS files in force, which follow the files on disk: new ones are taken up
// only if they can be used, all three at once. Any thread may call.
#pragma once

#include <absl/status/statusor.h>

#include <condition_variable>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "server/access/tls_files.h"

namespace selfcal::server {

class TlsReload {
 public:
  // Receives a text for the log: true if new files are in force, false if they
  // cannot be used, with the reason.
  using Report = std::function<void(bool in_force, const std::string& text)>;

  // Looks at the files every options.refresh_s. Errors are those of
  // ReadTlsFiles.
  static absl::StatusOr<std::unique_ptr<TlsReload>> Start(
      const TlsOptions& options,
      std::function<std::int64_t()> now_s,
      Report report);
  ~TlsReload();
  TlsReload(const TlsReload&) = delete;
  TlsReload& operator=(const TlsReload&) = delete;

  std::shared_ptr<const TlsFiles> Current() const;
  // The reason why the files on disk are not in force; empty if they are.
  std::string Problem() const;

 private:
  TlsReload(const TlsOptions& options,
            std::function<std::int64_t()> now_s,
            Report report,
            TlsFiles files);
  void Run();
  void Look();

  const TlsOptions options_;
  const std::function<std::int64_t()> now_s_;
  const Report report_;
  mutable std::mutex mutex_;  // guards what follows
  std::shared_ptr<const TlsFiles> current_;
  std::string problem_;
  bool stopping_ = false;
  std::condition_variable changed_;
  std::thread thread_;
};

}  // namespace selfcal::server
