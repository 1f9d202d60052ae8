// The spool of a stream, as segments: numbers them, writes them to disk, and
// reads back, oldest first, those that the window does not have. Without a
// spool folder, or if it cannot be used, it holds nothing and stays so.
//
// After a failure of the disk, or when the disk or the folder is full, the
// spool is blocked, until kSpoolRetry has passed or a file has been removed.
// The keeper neither writes nor reads meanwhile. The report records each
// outcome.
//
// Waits for the disk. Not thread-safe: the keeper owns it.
#pragma once

#include <absl/status/status.h>

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "client/selfcal/client.h"
#include "client/selfcal/encoded_segment.h"
#include "client/selfcal/spool.h"

namespace selfcal::client {

// State of the spool; the counts are those of StreamStatistics.
struct SpoolReport {
  bool opened = false;        // or it is known that there is none
  bool has_unloaded = false;  // segments are on disk, but not in the window
  absl::Status status;        // of the last attempt to use the spool
  std::uint64_t segments = 0;
  std::uint64_t bytes = 0;
  std::uint64_t spooled = 0;
  std::uint64_t recovered = 0;
  std::uint64_t damaged = 0;
  std::uint64_t failures = 0;
};

class SpooledSegments {
 public:
  using Clock = std::chrono::steady_clock;
  static constexpr std::chrono::milliseconds kSpoolRetry{1000};

  SpooledSegments() = default;  // no spool
  // Opens the folder of the rig if there is a spool folder. The report states
  // why it cannot be used.
  static SpooledSegments Open(const ClientOptions& options);

  // False if there is no spool, or it could not be opened.
  bool exists() const { return spool_ != nullptr; }
  bool blocked() const { return retry_at_.has_value(); }

  // Returns the number of the next segment that the stream accepts: larger than
  // those of all before, in this process and on disk.
  std::uint64_t NextNumber() { return next_number_++; }

  // Write, ReadUnloaded and Remove need a spool that exists; the first two
  // throw std::bad_alloc.

  // Writes a segment. If it returns true, the segment is on disk; if not, the
  // spool is blocked.
  bool Write(const EncodedSegment& segment);
  // Reads the oldest unloaded segment; it remains unloaded until MarkLoaded. If
  // it returns nullopt, the segment was damaged and is quarantined, or could
  // not be read and the spool is blocked. Needs report().has_unloaded.
  std::optional<EncodedSegment> ReadUnloaded();
  void MarkLoaded(std::uint64_t number);
  // Removes segments that are acknowledged; the spool is no longer blocked.
  void Remove(const std::vector<std::uint64_t>& numbers);

  // Blocks the spool, e.g. for lack of memory.
  void Block() { retry_at_ = Clock::now() + kSpoolRetry; }
  // Ends the block if its time has passed.
  void RetryIfDue(Clock::time_point now);
  // Returns the time at which the block ends; nullopt if there is none.
  std::optional<Clock::time_point> retry_at() const { return retry_at_; }

  const SpoolReport& report() const { return report_; }

 private:
  void UpdateReport();

  std::string parent_;  // resource name of the rig
  std::unique_ptr<Spool> spool_;
  std::uint64_t next_number_ = 1;
  std::uint64_t loaded_ = 0;  // files up to this number are in the window
  std::optional<Clock::time_point> retry_at_;
  SpoolReport report_;
};

}  // namespace selfcal::client
