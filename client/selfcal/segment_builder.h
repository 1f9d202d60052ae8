// Builds motion segments from the keyframes of a SLAM system.
//
// Feed every IMU sample, and every keyframe with its observations, each in
// order of time; either stream may run ahead of the other by up to max_gap_s. A
// segment is complete when it has its number of keyframes (or seconds), the
// keyframe after it has arrived, and the IMU samples have reached that
// keyframe, and padding_s beyond the last one of the segment: these samples
// belong to the segment, so that neighbours can be joined, and no motion about
// a keyframe is extrapolated. Samples about the first keyframe of the next
// segment are part of both. Take complete segments after each call:
//
//   builder.AddImu(sample);
//   builder.AddKeyframe(state, observations);
//   while (auto closed = builder.TakeClosed()) stream.Send(*std::move(closed));
//
// Differences between SLAM systems:
//
//  - Tracks without a position (KeyframeObservation::p_G) are triangulated when
//    the segment is assembled, with the theta of the SLAM system.
//  - States that hold at the exposure and not at the timestamp of the images
//    are moved, if AddKeyframe gets the timestamp.
//  - Observations outside the image are dropped, if theta is known.
//  - SetHealthy(false) drops what a diverging filter has estimated.
//  - Ids of landmarks may start again after a break: after SetHealthy(true),
//    and after a time without keyframes of over max_gap_s. G may be another
//    one, too.
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
#include "core/model/calibration.h"
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
  // True if ids of landmarks after such a gap denote other landmarks than
  // before it; false for a SLAM system with a map, which recognises them.
  bool new_ids_after_gap = true;
  // The calibration that the SLAM system uses (SetTheta); one that is not valid
  // is ignored.
  std::optional<Calibration> theta = std::nullopt;
  // Standard deviation of an observation, used in triangulation.
  double pixel_sigma_px = 1;
  double gravity_mps2 = 9.81;  // of the SLAM system, along -z of G
  // A segment has the samples of this time before its first keyframe, and after
  // its last one, as far as there are any when it is flushed.
  double padding_s = kImuPadding_s;
  // The time at which the session began, for a builder that continues one; by
  // default that of the first keyframe. The time offset of a camera whose clock
  // drifts is that of this time.
  std::optional<std::int64_t> session_start_ns = std::nullopt;
};

struct SegmentBuilderStatistics {
  std::uint64_t segments = 0;  // completed
  // Keyframes that were not later than the keyframe before them, or with a
  // state too far from its images.
  std::uint64_t keyframes_refused = 0;
  // Keyframes that were accepted but are in no segment: no IMU sample covers
  // them, their segment was too short when it was flushed, only one came
  // between two versions, or memory ran out.
  std::uint64_t keyframes_dropped = 0;
  // Keyframes that were in the current segment when the SLAM system became
  // unhealthy, or came while it was.
  std::uint64_t keyframes_unhealthy = 0;
  // IMU samples that were not later than the sample before them.
  std::uint64_t imu_ignored = 0;
  // Observations outside the image, or not finite.
  std::uint64_t observations_dropped = 0;
  // Tracks in the segments that Take has assembled (AssemblyStatistics). Those
  // of TakeClosed are counted by the SegmentStream that they are sent on.
  std::uint64_t tracks_triangulated = 0;
  std::uint64_t tracks_dropped = 0;
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

  // The same of a second IMU, for a rig that has one. Once a sample was added,
  // segments wait for its samples as for those of the first one, and keyframes
  // that they do not cover are dropped.
  bool AddSecondImu(const ImuSample& sample) noexcept;

  // Adds a keyframe whose state holds at the timestamp of its images. Returns
  // false and refuses the keyframe if it is not later than the keyframe before
  // it, or the SLAM system is not healthy. If a camera observes a landmark
  // several times, the first observation is used. The last p_G of a landmark
  // within the segment is the one that is sent.
  bool AddKeyframe(const KeyframeState& state,
                   std::span<const KeyframeObservation> observations) noexcept;

  // Adds a keyframe whose state holds at another time, state.t_ns: for a filter
  // that estimates its state at the exposure, at image_t_ns plus its time
  // offset. When the segment is assembled, the state is moved along the IMU
  // samples to image_t_ns, which is where the contract has it. Also refuses the
  // keyframe if the times are more than 0.5 s apart.
  bool AddKeyframe(const KeyframeState& state,
                   std::int64_t image_t_ns,
                   std::span<const KeyframeObservation> observations) noexcept;

  // Sets the version that the states from the next keyframe on are estimated
  // with. The current segment ends before that keyframe, as if it had all its
  // keyframes, however few (but at least 2).
  void SetCalibrationVersion(std::int64_t version) noexcept;

  // Sets the calibration with which the SLAM system estimates the states from
  // the next keyframe on: the values of its version, or its own, if it
  // calibrates itself. May be called for every keyframe; a segment uses that of
  // its last one. Returns false and ignores a calibration that is not valid, or
  // for which there is no memory.
  bool SetTheta(const Calibration& theta) noexcept;

  // States whether the SLAM system is to be trusted, as it is at first. False
  // drops the current segment and refuses keyframes until it is true again;
  // then a new segment begins, with new landmarks. Complete segments remain.
  void SetHealthy(bool healthy) noexcept;

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
  // builder continues with a new segment of the same session. Its index is the
  // next one; it is one more if the flushed segment has samples up to its first
  // keyframe, so that they are not joined.
  void Flush(int min_keyframes) noexcept;

  // Least index of the next segment.
  std::int64_t next_index() const noexcept;
  SegmentBuilderStatistics statistics() const noexcept;

 private:
  struct State;
  std::unique_ptr<State> state_;  // null if memory ran out
};

}  // namespace selfcal::client
