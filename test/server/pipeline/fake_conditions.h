// Conditions of the host that a test sets.
#pragma once

#include <mutex>
#include <string>

#include "server/pipeline/pipeline.h"

namespace selfcal::server {

class FakeConditions final : public Conditions {
 public:
  std::string DeferReason() override {
    const std::lock_guard lock(mutex_);
    return reason_;
  }
  // Empty: nothing holds back.
  void Set(const std::string& reason) {
    const std::lock_guard lock(mutex_);
    reason_ = reason;
  }

 private:
  std::mutex mutex_;
  std::string reason_;
};

}  // namespace selfcal::server
