// What a SLAM process links: stream segments to selfcald and receive
// calibrations, never blocking the caller.
//
// Every method but Drain returns at once, whatever the daemon and the disk do,
// and may be called from any thread; threads of the client's own encode, write,
// talk to the daemon, reconnect with exponential backoff and jitter, and send
// again what was not acknowledged. Callbacks run one at a time on a thread of
// the client's: they should be short, and must not destroy the object that
// calls them. A destructor waits for a callback that is running, and that of a
// stream with a spool for the disk; and where a daemon stands still in the
// middle of a message, as a process under SIGSTOP, that of a stream waits until
// it goes on or gRPC gives the connection up. No function throws, and what a
// callback throws is caught and counted. An object for which there was no
// memory, or no thread, does nothing and says RESOURCE_EXHAUSTED. (gRPC itself
// ends the process when it finds no memory.)
#pragma once

#include <absl/status/status.h>

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "client/selfcal/closed_segment.h"
#include "core/model/calibration.h"
#include "core/model/segment.h"

namespace selfcal::client {

struct ClientOptions {
  std::string target = "unix:/run/selfcal/selfcald.sock";  // as gRPC names it
  std::string rig;             // {rig}, without "rigs/"
  int max_queue = 16;          // segments in memory, waiting or unacknowledged
  int max_unacknowledged = 4;  // sent before the first of them is acknowledged
  std::chrono::milliseconds min_backoff{100};
  std::chrono::milliseconds max_backoff{5000};

  // For a TCP target with mutual TLS: PEM files, read at every connection. All
  // empty: no TLS. The authority alone: the daemon is known by its certificate,
  // this side by none.
  std::string ca_file = {};           // authorities that the daemon's may be of
  std::string certificate_file = {};  // this client's, with its chain
  std::string key_file = {};

  // Where segments go that memory has no room for, in a folder named after the
  // rig; empty: nowhere, they are dropped. One stream at a time may use it.
  std::string spool_dir = {};
  std::uint64_t max_spool_bytes = 256u << 20;
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
  std::uint64_t dropped = 0;            // refused by Send, or no memory later
  std::uint64_t resent = 0;             // sent once more after a reconnection
  std::uint64_t connections = 0;        // on which the daemon answered
  std::uint64_t callback_failures = 0;  // callbacks that threw
  // Of the spool: segments written to it, found in it at the start, set aside
  // because the file was not what was written, errors of the disk.
  std::uint64_t spooled = 0;
  std::uint64_t spool_recovered = 0;
  std::uint64_t spool_damaged = 0;
  std::uint64_t spool_failures = 0;
  // What is in it now.
  std::uint64_t spool_segments = 0;
  std::uint64_t spool_bytes = 0;
};

class SegmentStream {
 public:
  using AckCallback = std::function<void(const Acknowledgement&)>;
  // `on_ack` may be null. The connection is made when there is something to
  // send: also what an earlier process left in the spool.
  SegmentStream(const ClientOptions& options, AckCallback on_ack) noexcept;
  // What is unacknowledged then goes to the spool. Without one, or where it has
  // no room, it is given up: Drain first.
  ~SegmentStream();
  SegmentStream(const SegmentStream&) = delete;
  SegmentStream& operator=(const SegmentStream&) = delete;

  // Queues a segment; segments are sent in this order. False, and the segment
  // is counted as dropped, if memory and spool are full or the stream has
  // ended: what is older stays.
  bool Send(MotionSegment segment) noexcept;
  bool Send(ClosedSegment segment) noexcept;

  // Waits until everything queued, and what is in the spool, is acknowledged
  // and its callbacks have returned. DEADLINE_EXCEEDED, or the error that ended
  // the stream for good (NOT_FOUND: the rig does not exist; INVALID_ARGUMENT,
  // PERMISSION_DENIED, UNAUTHENTICATED). Any other error is of the connection,
  // which is made again. Not to be called from a callback.
  absl::Status Drain(std::chrono::milliseconds timeout) noexcept;

  StreamStatistics statistics() const noexcept;
  // OK, or the last error of the connection while it is down.
  absl::Status connection_status() const noexcept;
  // OK, or why the last attempt to use the spool failed.
  absl::Status spool_status() const noexcept;

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
  CalibrationWatch(const ClientOptions& options, Callback callback) noexcept;
  ~CalibrationWatch();
  CalibrationWatch(const CalibrationWatch&) = delete;
  CalibrationWatch& operator=(const CalibrationWatch&) = delete;

  // OK, or the last error of the connection while it is down.
  absl::Status connection_status() const noexcept;
  std::uint64_t callback_failures() const noexcept;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace selfcal::client
