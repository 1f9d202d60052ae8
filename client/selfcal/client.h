// What a SLAM process links: stream segments to selfcald and receive
// calibrations, never blocking the caller.
//
// Every method returns at once; a thread of the client's own talks to the
// daemon, reconnects with backoff, and sends again what was not acknowledged.
// Callbacks run on that thread. No exception leaves this boundary.
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
  std::string rig;      // {rig}, without "rigs/"
  int max_queue = 16;   // segments waiting or unacknowledged
  std::chrono::milliseconds min_backoff{100};
  std::chrono::milliseconds max_backoff{5000};
};

// The daemon's verdict on one segment.
struct Acknowledgement {
  enum class Verdict { kStored, kDuplicate, kRejected };
  SegmentKey key;
  Verdict verdict = Verdict::kStored;
  std::vector<Violation> violations;
};

struct StreamStatistics {
  std::uint64_t queued = 0;     // accepted by Send
  std::uint64_t stored = 0;
  std::uint64_t duplicates = 0;
  std::uint64_t rejected = 0;
  std::uint64_t dropped = 0;    // refused by Send because the queue was full
  std::uint64_t resent = 0;
  std::uint64_t connections = 0;
};

class SegmentStream {
 public:
  using AckCallback = std::function<void(const Acknowledgement&)>;
  SegmentStream(const ClientOptions& options, AckCallback on_ack);
  ~SegmentStream();  // what is unacknowledged then is given up: Drain first
  SegmentStream(const SegmentStream&) = delete;
  SegmentStream& operator=(const SegmentStream&) = delete;

  // Queues a segment. False, and the segment is counted as dropped, if the
  // queue is full. Never blocks.
  bool Send(MotionSegment segment);

  // Waits until everything queued is acknowledged. DEADLINE_EXCEEDED, or the
  // error that ends the stream for good (e.g. NOT_FOUND: the rig does not
  // exist).
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
  Eigen::MatrixXd covariance;  // of the tangent, D x D
};

// Calls back with the active calibration at once and with every newer one;
// survives restarts of the daemon, and tells no version twice.
class CalibrationWatch {
 public:
  using Callback = std::function<void(const CalibrationVersion&)>;
  CalibrationWatch(const ClientOptions& options, Callback callback);
  ~CalibrationWatch();
  CalibrationWatch(const CalibrationWatch&) = delete;
  CalibrationWatch& operator=(const CalibrationWatch&) = delete;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace selfcal::client
