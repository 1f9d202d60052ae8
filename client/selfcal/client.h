// The client library for a SLAM process: it streams segments to selfcald and
// receives calibrations, and never blocks the caller.
//
// Threads: Every method except Drain returns at once, whatever the daemon and
// the disk do, and may be called from any thread. The client has its own
// threads, which encode, write to the spool, communicate with the daemon,
// reconnect with exponential backoff and jitter, and resend what was not
// acknowledged.
//
// Callbacks: They run one at a time on a thread of the client. They should be
// short, and must not destroy the object that calls them. Exceptions that a
// callback throws are caught and counted.
//
// Destructors: A destructor waits for a callback that is running. That of a
// stream with a spool also waits for the disk. If the daemon hangs in the
// middle of a message, e.g. under SIGSTOP, the destructor of a stream waits
// until the daemon continues or gRPC gives up the connection.
//
// Errors: No function throws. An object whose construction ran out of memory or
// threads does nothing and reports RESOURCE_EXHAUSTED. (gRPC itself aborts the
// process when it runs out of memory.)
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
  // Address of the daemon, in the syntax of gRPC.
  std::string target = "unix:/run/selfcal/selfcald.sock";
  std::string rig;  // {rig}, without "rigs/"
  // Segments in memory, waiting or unacknowledged; with a spool at least 2.
  int max_queue = 16;
  // Segments that are sent before the first of them is acknowledged.
  int max_unacknowledged = 4;
  std::chrono::milliseconds min_backoff{100};
  std::chrono::milliseconds max_backoff{5000};

  // PEM files for a TCP target with mutual TLS, read at every connection. If
  // all are empty, TLS is not used. If only ca_file is given, the daemon is
  // authenticated by its certificate, and the client is not authenticated.
  std::string ca_file =
      {};  // authorities that may sign the daemon's certificate
  std::string certificate_file = {};  // the client's, with its chain
  std::string key_file = {};

  // Folder for segments that do not fit into memory; they go into a subfolder
  // named after the rig, which one stream at a time may use. If empty, such
  // segments are dropped.
  std::string spool_dir = {};
  std::uint64_t max_spool_bytes = 256u << 20;
};

// The daemon's verdict on one segment.
struct Acknowledgement {
  enum class Verdict { kStored, kDuplicate, kRejected };
  SegmentKey key;
  Verdict verdict = Verdict::kStored;
  std::vector<Violation> violations;  // the reasons for a rejection
  // Observations outside the image that the daemon has left out of a segment
  // that it stored.
  std::uint64_t observations_dropped = 0;
  // Readings of the IMU beyond its full scale, left out likewise.
  std::uint64_t readings_dropped = 0;
};

// Counts of segments unless stated otherwise.
struct StreamStatistics {
  std::uint64_t queued = 0;  // accepted by Send
  std::uint64_t stored = 0;
  std::uint64_t duplicates = 0;
  std::uint64_t rejected = 0;
  std::uint64_t dropped = 0;            // refused by Send, or out of memory
  std::uint64_t resent = 0;             // sent again after a reconnection
  std::uint64_t connections = 0;        // connections that the daemon answered
  std::uint64_t callback_failures = 0;  // callbacks that threw
  // Tracks in the closed segments that were assembled (AssemblyStatistics).
  std::uint64_t tracks_triangulated = 0;
  std::uint64_t tracks_dropped = 0;
  // Observations that the daemon has left out (Acknowledgement).
  std::uint64_t observations_dropped = 0;
  std::uint64_t spooled = 0;          // written to the spool
  std::uint64_t spool_recovered = 0;  // found in the spool at the start
  // Quarantined in the spool, because the file differs from what was written.
  std::uint64_t spool_damaged = 0;
  std::uint64_t spool_failures = 0;  // disk errors
  // Present content of the spool.
  std::uint64_t spool_segments = 0;
  std::uint64_t spool_bytes = 0;
  // Readings of the IMU that the daemon has left out (Acknowledgement).
  std::uint64_t readings_dropped = 0;
};

// Sends segments to the daemon, in order and at least once.
class SegmentStream {
 public:
  using AckCallback = std::function<void(const Acknowledgement&)>;
  // `on_ack` may be null. The stream connects when there is something to send,
  // which includes segments that an earlier process left in the spool.
  SegmentStream(const ClientOptions& options, AckCallback on_ack) noexcept;
  // Writes unacknowledged segments to the spool. Without a spool, or if it is
  // full, they are lost: call Drain first.
  ~SegmentStream();
  SegmentStream(const SegmentStream&) = delete;
  SegmentStream& operator=(const SegmentStream&) = delete;

  // Queues a segment; segments are sent in the order of these calls. Returns
  // false and counts the segment as dropped if memory and spool are full or the
  // stream has ended; older segments stay in the queue.
  bool Send(MotionSegment segment) noexcept;
  bool Send(ClosedSegment segment) noexcept;

  // Waits until all segments in the queue and in the spool are acknowledged and
  // their callbacks have returned. Returns DEADLINE_EXCEEDED after `timeout`,
  // or the error that ended the stream permanently (NOT_FOUND: the rig does not
  // exist; INVALID_ARGUMENT, PERMISSION_DENIED, UNAUTHENTICATED). After any
  // other error the stream reconnects. Must not be called from a callback.
  absl::Status Drain(std::chrono::milliseconds timeout) noexcept;

  StreamStatistics statistics() const noexcept;
  // OK, or the last error while the connection is down.
  absl::Status connection_status() const noexcept;
  // OK, or the error of the last attempt to use the spool.
  absl::Status spool_status() const noexcept;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

// One version of a rig's calibration, as published.
struct CalibrationVersion {
  // The conclusion of the daemon's checks. An active version ceases to be
  // trustworthy if the device has changed since, e.g. by a shock, or if a later
  // check contradicts it: the uncertainty then says nothing about its error.
  enum class Verdict {
    kUnknown,  // none, or one that this program does not know
    kGood,
    kWeak,  // right, but some directions are hardly known
    kNotTrustworthy,
    kFactory,  // the rig was created with it; nothing was estimated
  };
  std::int64_t version = 0;
  Calibration theta;
  // Covariance of the tangent components, D x D; 0 x 0 if it is not known.
  Eigen::MatrixXd covariance;
  Verdict verdict = Verdict::kUnknown;
  std::vector<std::string> reasons;  // for the verdict, a sentence each
};

// A version at a temperature [deg C]: without slopes, with the covariance of
// the values there. It is the version itself if it has no slopes, whose values
// do not vary with temperature.
CalibrationVersion AtTemperature(const CalibrationVersion& version,
                                 double temperature_c);

// Watches the active calibration of a rig. Calls back with the active version
// at once, with each version that becomes active later, and again with the
// active one when its verdict changes. Reconnects when the daemon restarts, and
// waits for a rig that does not exist yet. A slow callback gets the newest
// version; none is delivered twice in a row with the same verdict.
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
