#include "server/pipeline/version_completion.h"

#include <spdlog/spdlog.h>

namespace selfcal::server {
namespace {

constexpr int kVersionsAtOnce = 1000;
constexpr std::chrono::minutes kCompletionInterval{1};

}  // namespace

void VersionCompletion::Continue() {
  if (!estimates_complete_) {
    const auto written = domain_->CompleteEstimates(kVersionsAtOnce);
    if (written.ok()) {
      estimates_complete_ = *written == 0;
    } else {
      spdlog::warn("parameters of some versions are not in lists yet: {}",
                   written.status().ToString());
    }
  }
  const auto now = Clock::now();
  if (now < look_again_) return;
  const auto written = domain_->CompleteVersions(kVersionsAtOnce);
  if (!written.ok()) {
    spdlog::warn("lists do not find some versions by their verdict yet: {}",
                 written.status().ToString());
  }
  if (!written.ok() || *written == 0) look_again_ = now + kCompletionInterval;
}

}  // namespace selfcal::server
