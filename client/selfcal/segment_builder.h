// Builds motion segments from the keyframes of a SLAM system.
//
// Feed, each in order of time, every IMU sample and every keyframe with the
// landmarks it sees; the two streams may run ahead of each other by up to
// max_gap_s. A segment is complete when it has its number of keyframes (or
// seconds), the keyframe after it has come, and the IMU samples have reached
// that one: they belong to the segment, so that neighbours can be joined. Take
// complete segments after each call:
//
//   builder.AddImu(sample);
//   builder.AddKeyframe(state, observations);
//   while (auto closed = builder.TakeClosed()) stream.Send(*std::move(closed));
//
// Each call takes microseconds: what is handed in is copied once, and a segment
// leaves by move. Memory is bounded: by what one segment holds, and by what the
// caller leaves untaken. Not thread-safe. Bad input is refused and counted,
// never fatal; no function throws. When there is no memory, the segment at hand
// is dropped and counted.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "client/selfcal/closed_segment.h"
#include "core/model/segment.h"

namespace selfcal::client {

struct SegmentBuilderOptions {
  std::string session;
  std::int64_t first_index = 0;
  std::int64_t calibration_version = 1;
  int keyframes = 40;  // close after this many (at least 2) ...
  double seconds = 0;  // ... or, if > 0, after this long instead
  // Landmarks seen fewer times in the segment are left out.
  int min_observations = 3;
  // Keyframes further apart than this are not of one segment: the builder
  // flushes between them. The default is what the daemon accepts.
  double max_gap_s = 10;
  // Segments shorter than this after such a gap are dropped.
  int min_keyframes = 10;
};

struct SegmentBuilderStatistics {
  std::uint64_t segments = 0;  // completed
  // Keyframes at or before the last one.
  std::uint64_t keyframes_refused = 0;
  // Accepted, but in no segment: no IMU sample covers them, the rest they
  // belong to was too short, or there was no memory.
  std::uint64_t keyframes_dropped = 0;
  // IMU samples at or before the last one.
  std::uint64_t imu_ignored = 0;
  // Calls that found no memory; each gave up the segment at hand.
  std::uint64_t out_of_memory = 0;
};

class SegmentBuilder {
 public:
  explicit SegmentBuilder(const SegmentBuilderOptions& options) noexcept;
  ~SegmentBuilder();
  // What was moved from refuses everything.
  SegmentBuilder(SegmentBuilder&&) noexcept;
  SegmentBuilder& operator=(SegmentBuilder&&) noexcept;

  // False, and ignored, if it is not later than the sample before it.
  bool AddImu(const ImuSample& sample) noexcept;

  // False, and refused, if it is not later than the keyframe before it. Of
  // several observations of one landmark by one camera the first counts; the
  // last p_G given for a landmark within the segment is the one that is sent.
  bool AddKeyframe(const KeyframeState& state,
                   std::span<const KeyframeObservation> observations) noexcept;

  // The device's temperature from now on [degrees Celsius]; nothing: it is not
  // known. A segment carries what was given last when it is completed.
  // False, and ignored, for what the daemon would not accept (-100 to 200).
  bool SetTemperature(std::optional<double> temperature_c) noexcept;

  // The oldest complete segment, if there is one: as it was collected, for
  // SegmentStream::Send, or put together here, which takes some milliseconds.
  std::optional<ClosedSegment> TakeClosed() noexcept;
  std::optional<MotionSegment> Take() noexcept;

  // Ends the segment at hand, at the end of a session or where tracking was
  // lost: with at least max(2, min_keyframes) keyframes that the IMU samples
  // cover it is complete, otherwise it is dropped. The builder then starts
  // anew, with the next index of the same session.
  void Flush(int min_keyframes) noexcept;

  // Index that the next segment gets.
  std::int64_t next_index() const noexcept;
  SegmentBuilderStatistics statistics() const noexcept;

 private:
  struct State;
  std::unique_ptr<State> state_;  // null if there was no memory for it
};

}  // namespace selfcal::client
