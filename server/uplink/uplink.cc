#include "server/uplink/uplink.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <exception>
#include <utility>

#include "server/pipeline/backoff.h"
#include "server/store/outbox.h"
#include "server/uplink/reporter.h"

namespace selfcal::server {
namespace {

using SteadyClock = std::chrono::steady_clock;

// How often the outbox is looked at.
constexpr std::chrono::milliseconds kLookAfter{500};

// A round of reports; what it throws, e.g. for a lack of memory, is its error.
absl::StatusOr<Reporter::Round> ReportGuarded(Reporter* reporter,
                                              const Reporter::Pace& pace) {
  try {
    return reporter->ReportOnce(SteadyClock::now(), pace);
  } catch (const std::exception& error) {
    return absl::InternalError(error.what());
  }
}

}  // namespace

Uplink::Uplink(Store* store,
               const Api* api,
               std::unique_ptr<Hub> hub,
               const UplinkOptions& options,
               std::string program_version)
    : store_(store),
      api_(api),
      hub_(std::move(hub)),
      options_(options),
      program_version_(std::move(program_version)) {}

Uplink::~Uplink() { Stop(); }

absl::Status Uplink::Start() {
  absl::Status status = store_->outbox()->SetData(options_.data);
  if (status.ok()) thread_ = std::thread([this] { Run(); });
  return status;
}

void Uplink::Stop() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  hub_->Cancel();
  stop_.notify_all();
  if (thread_.joinable()) thread_.join();
}

bool Uplink::Wait(SteadyClock::duration duration) {
  std::unique_lock lock(mutex_);
  return !stop_.wait_for(lock, duration, [this] { return stopping_; });
}

void Uplink::Run() {
  Reporter reporter(store_, api_, hub_.get(), options_, program_version_);
  SteadyClock::time_point next{};  // no report before, by the limit
  const auto pace = [&](std::int64_t bytes) {
    if (!Wait(next - SteadyClock::now())) return false;
    if (options_.max_bytes_per_s > 0) {
      next = SteadyClock::now() +
             std::chrono::duration_cast<SteadyClock::duration>(
                 std::chrono::duration<double>(
                     static_cast<double>(bytes) /
                     static_cast<double>(options_.max_bytes_per_s)));
    }
    return true;
  };
  std::string problem;  // that was logged last; empty: none
  Backoff backoff;
  SteadyClock::duration wait = SteadyClock::duration::zero();
  while (Wait(wait)) {
    const auto round = ReportGuarded(&reporter, pace);
    const absl::Status status = round.ok() ? round->status : round.status();
    if (absl::IsCancelled(status)) break;
    if (status.message() != problem) {
      problem = std::string(status.message());
      if (status.ok()) {
        spdlog::info("uplink: {} takes reports again", options_.hub);
      } else {
        spdlog::warn("uplink: {}: {}; what is to be reported waits",
                     options_.hub,
                     problem);
      }
    }
    if (!status.ok()) {
      wait = std::max<SteadyClock::duration>(backoff.Next(), kLookAfter);
      continue;
    }
    backoff.Reset();
    const bool has_more = round->reports > 0 && round->waiting > 0;
    wait = has_more ? SteadyClock::duration::zero() : kLookAfter;
  }
}

}  // namespace selfcal::server
