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
//   while (auto segment = builder.Take()) stream.Send(*std::move(segment));
//
// Memory is bounded: by what one segment holds, and by what the caller leaves
// untaken. Not thread-safe. Bad input is refused and counted, never fatal.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "core/model/segment.h"

namespace selfcal::client {

// What the SLAM system says when it makes a keyframe.
struct KeyframeObservation {
  std::int32_t camera = 0;
  std::uint64_t landmark_id = 0;
  Eigen::Vector2d z_px = Eigen::Vector2d::Zero();
  Eigen::Vector3d p_G = Eigen::Vector3d::Zero();  // landmark's estimate [m]
};

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
  // Accepted, but in no segment: no IMU sample covers them, or the rest they
  // belong to was too short.
  std::uint64_t keyframes_dropped = 0;
  // IMU samples at or before the last one.
  std::uint64_t imu_ignored = 0;
};

class SegmentBuilder {
 public:
  explicit SegmentBuilder(const SegmentBuilderOptions& options);
  ~SegmentBuilder();
  SegmentBuilder(SegmentBuilder&&) noexcept;
  SegmentBuilder& operator=(SegmentBuilder&&) noexcept;

  // False, and ignored, if it is not later than the sample before it.
  bool AddImu(const ImuSample& sample);

  // False, and refused, if it is not later than the keyframe before it. Of
  // several observations of one landmark by one camera the first counts; the
  // last p_G given for a landmark within the segment is the one that is sent.
  bool AddKeyframe(const KeyframeState& state,
                   std::span<const KeyframeObservation> observations);

  // The oldest complete segment, if there is one.
  std::optional<MotionSegment> Take();

  // Ends the segment at hand, at the end of a session or where tracking was
  // lost: with at least max(2, min_keyframes) keyframes that the IMU samples
  // cover it is complete, otherwise it is dropped. The builder then starts
  // anew, with the next index of the same session.
  void Flush(int min_keyframes);

  // Index that the next segment gets.
  std::int64_t next_index() const;
  SegmentBuilderStatistics statistics() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace selfcal::client
