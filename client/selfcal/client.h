// What a SLAM process links: stream segments to selfcald and receive
// calibrations, never blocking the caller.
//
// Every method but Drain returns at once and may be called from any thread; a
// thread of the client's own talks to the daemon, reconnects with exponential
// backoff and jitter, and sends again what was not acknowledged. Callbacks run
// one at a time on a thread of the client's: they should be short, and must not
// destroy the object that calls them. A destructor waits for a callback that is
// running, and for nothing else. No exception leaves this boundary, and one
// that a callback throws is caught and counted.
#pragma once

#include <absl/status/status.h>

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "core/model/calibration.h"
#include "core/model/segment.h"

namespace selfcal::client {

struct ClientOptions {
  std::string target = "unix:/run/selfcal/selfcald.sock";  // as gRPC names it
  std::string rig;             // {rig}, without "rigs/"
  int max_queue = 16;          // segments waiting or unacknowledged
  int max_unacknowledged = 4;  // sent before the first of them is acknowledged
  std::chrono::milliseconds min_backoff{100};
  std::chrono::milliseconds max_backoff{5000};
};

// The daemon's verdict on one segment.
struct Acknowledgement {
  enum class Verdict { kStored, kDuplicate, kRejected };
  SegmentKey key;
  Verdict verdict = Verdict::kStored;
  std::vector<Violation> violations;  // of a rejected one
};

struct StreamStatistics {
  std::uint64_t queued = 0;  // accepted by Send
  std::uint64_t stored = 0;
  std::uint64_t duplicates = 0;
  std::uint64_t rejected = 0;
  std::uint64_t dropped = 0;            // refused by Send
  std::uint64_t resent = 0;             // sent once more after a reconnection
  std::uint64_t connections = 0;        // on which the daemon answered
  std::uint64_t callback_failures = 0;  // callbacks that threw
};

class SegmentStream {
 public:
  using AckCallback = std::function<void(const Acknowledgement&)>;
  // `on_ack` may be null. The connection is made when there is something to
  // send.
  SegmentStream(const ClientOptions& options, AckCallback on_ack);
  ~SegmentStream();  // what is unacknowledged then is given up: Drain first
  SegmentStream(const SegmentStream&) = delete;
  SegmentStream& operator=(const SegmentStream&) = delete;

  // Queues a segment; segments are sent in this order. False, and the segment
  // is counted as dropped, if the queue is full or the stream has ended.
  bool Send(MotionSegment segment);

  // Waits until everything queued is acknowledged and its callbacks have
  // returned. DEADLINE_EXCEEDED, or the error that ended the stream for good
  // (NOT_FOUND: the rig does not exist; INVALID_ARGUMENT, PERMISSION_DENIED,
  // UNAUTHENTICATED). Any other error is of the connection, which is made
  // again. Not to be called from a callback.
  absl::Status Drain(std::chrono::milliseconds timeout);

  StreamStatistics statistics() const;
  // OK, or the last error of the connection while it is down.
  absl::Status connection_status() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

// One version of a rig's calibration, as published.
struct CalibrationVersion {
  std::int64_t version = 0;
  Calibration theta;
  Eigen::MatrixXd covariance;  // of the tangent, D x D; 0 x 0 if not given
};

// Calls back with the active calibration at once and with each one that becomes
// active after it; survives restarts of the daemon, and tells no version twice
// in a row. A slow callback is told the newest. A rig that does not exist yet
// is waited for.
class CalibrationWatch {
 public:
  using Callback = std::function<void(const CalibrationVersion&)>;
  CalibrationWatch(const ClientOptions& options, Callback callback);
  ~CalibrationWatch();
  CalibrationWatch(const CalibrationWatch&) = delete;
  CalibrationWatch& operator=(const CalibrationWatch&) = delete;

  // OK, or the last error of the connection while it is down.
  absl::Status connection_status() const;
  std::uint64_t callback_failures() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace selfcal::client
