// Builds motion segments from the keyframes of a SLAM system.
//
// Feed every IMU sample, and every keyframe with its observations, each in
// order of time; either stream may run ahead of the other by up to max_gap_s. A
// segment is complete when it has its number of keyframes (or seconds), the
// keyframe after it has arrived, and the IMU samples have reached that
// keyframe: these samples belong to the segment, so that neighbours can be
// joined. Take complete segments after each call:
//
//   builder.AddImu(sample);
//   builder.AddKeyframe(state, observations);
//   while (auto closed = builder.TakeClosed()) stream.Send(*std::move(closed));
//
// Each call takes microseconds: input is copied once, and a segment is moved
// out. Memory is bounded by one segment plus the segments that the caller has
// not taken. Not thread-safe. Bad input is refused and counted, never fatal; no
// function throws. When memory runs out, the current segment is dropped and
// counted.
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
  int keyframes = 40;  // keyframes in a segment, at least 2 ...
  double seconds = 0;  // ... or, if > 0, duration of a segment instead
  // Landmarks with fewer observations in the segment are excluded.
  int min_observations = 3;
  // Largest time between keyframes of one segment: the builder flushes between
  // keyframes that are further apart. The default is the limit of the daemon.
  double max_gap_s = 10;
  // Segments with fewer keyframes are dropped when they end at such a gap.
  int min_keyframes = 10;
};

struct SegmentBuilderStatistics {
  std::uint64_t segments = 0;  // completed
  // Keyframes that were not later than the keyframe before them.
  std::uint64_t keyframes_refused = 0;
  // Keyframes that were accepted but are in no segment: no IMU sample covers
  // them, their segment was too short when it was flushed, or memory ran out.
  std::uint64_t keyframes_dropped = 0;
  // IMU samples that were not later than the sample before them.
  std::uint64_t imu_ignored = 0;
  // Calls that ran out of memory; each dropped the current segment.
  std::uint64_t out_of_memory = 0;
};

class SegmentBuilder {
 public:
  explicit SegmentBuilder(const SegmentBuilderOptions& options) noexcept;
  ~SegmentBuilder();
  // A builder that was moved from refuses everything.
  SegmentBuilder(SegmentBuilder&&) noexcept;
  SegmentBuilder& operator=(SegmentBuilder&&) noexcept;

  // Adds a sample. Returns false and ignores the sample if it is not later than
  // the sample before it.
  bool AddImu(const ImuSample& sample) noexcept;

  // Adds a keyframe. Returns false and refuses the keyframe if it is not later
  // than the keyframe before it. If a camera observes a landmark several times,
  // the first observation is used. The last p_G of a landmark within the
  // segment is the one that is sent.
  bool AddKeyframe(const KeyframeState& state,
                   std::span<const KeyframeObservation> observations) noexcept;

  // Sets the temperature of the device [degrees Celsius] from now on; nullopt
  // if it is unknown. A segment carries the temperature that was set last when
  // it was completed. Returns false and ignores values that the daemon does not
  // accept (outside -100 to 200).
  bool SetTemperature(std::optional<double> temperature_c) noexcept;

  // Returns the oldest complete segment, if there is one. TakeClosed returns it
  // unassembled, for SegmentStream::Send. Take assembles it, which takes some
  // milliseconds.
  std::optional<ClosedSegment> TakeClosed() noexcept;
  std::optional<MotionSegment> Take() noexcept;

  // Ends the current segment, at the end of a session or where tracking was
  // lost. It is complete if the IMU samples cover at least
  // max(2, min_keyframes) of its keyframes, otherwise it is dropped. The
  // builder continues with a new segment of the same session, with the next
  // index.
  void Flush(int min_keyframes) noexcept;

  // Index of the next segment.
  std::int64_t next_index() const noexcept;
  SegmentBuilderStatistics statistics() const noexcept;

 private:
  struct State;
  std::unique_ptr<State> state_;  // null if memory ran out
};

}  // namespace selfcal::client
