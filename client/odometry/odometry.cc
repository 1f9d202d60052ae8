#include "client/odometry/odometry.h"

#include <algorithm>
#include <cstddef>
#include <map>
#include <utility>
#include <vector>

#include "client/odometry/keyframe_reader.h"
#include "core/model/temperature.h"
#include "core/motion/estimate_motion.h"

namespace selfcal::client {
namespace {

// The second IMU does not move the states: little may be known of its pose, and
// a calibration uses it.
Rig WithoutSecondImu(Rig rig) {
  rig.factory.imu1.reset();
  if (rig.prior_mean) rig.prior_mean->imu1.reset();
  return rig;
}

// theta at the temperature of the recording.
Calibration ThetaAt(const Calibration& theta, const OdometryOptions& options) {
  return AtTemperature(
      theta, options.temperature_c.value_or(theta.reference_temperature_c));
}

}  // namespace

class Odometry::Impl {
 public:
  Impl(Recording* recording,
       const Rig& rig,
       const Calibration& theta,
       const OdometryOptions& options)
      : recording_(recording),
        rig_(WithoutSecondImu(rig)),
        has_second_imu_(rig.factory.imu1.has_value()),
        options_(options),
        reader_(recording, rig, ThetaAt(theta, options), options),
        index_(options.first_index) {}

  absl::StatusOr<std::optional<OdometrySegment>> Next(const Calibration& theta,
                                                      std::int64_t version) {
    for (;;) {
      const bool more = reader_.more();
      if (more) {
        auto read = reader_.Next();
        if (!read.ok()) return read.status();
        if (*read) keyframes_.push_back(**std::move(read));
      }
      // A segment ends with the keyframe after it, at a gap, or at the end.
      const bool gap = keyframes_.size() > 1 && GapBeforeLast();
      const bool full =
          static_cast<int>(keyframes_.size()) > options_.keyframes;
      if (!gap && !full && more) continue;
      const bool followed = gap || full;
      std::optional<OdometrySegment> segment = Close(followed, theta, version);
      if (gap) before_.reset();
      if (segment) return segment;
      if (!more) return std::optional<OdometrySegment>();
    }
  }

  const OdometryProgress& progress() const { return reader_.progress(); }

 private:
  bool GapBeforeLast() const {
    const std::int64_t gap_ns =
        keyframes_.back().t_ns - keyframes_[keyframes_.size() - 2].t_ns;
    return 1e-9 * static_cast<double>(gap_ns) > options_.max_gap_s;
  }

  // Readings from kImuPadding_s before the first keyframe to as long after the
  // last one, or to the first keyframe of the next segment.
  static std::vector<ImuSample> Readings(const std::vector<ImuSample>& imu,
                                         std::int64_t from_ns,
                                         std::int64_t to_ns) {
    const auto padding_ns = static_cast<std::int64_t>(1e9 * kImuPadding_s);
    const auto earlier = [](const ImuSample& sample, std::int64_t t_ns) {
      return sample.t_ns < t_ns;
    };
    auto first =
        std::lower_bound(imu.begin(), imu.end(), from_ns - padding_ns, earlier);
    auto last =
        std::lower_bound(imu.begin(), imu.end(), to_ns + padding_ns, earlier);
    if (last != imu.end()) ++last;
    return {first, last};
  }

  // Takes the keyframes of the segment; `followed` if the last keyframe belongs
  // to the next one. nullopt if there are too few.
  std::optional<OdometrySegment> Close(bool followed,
                                       const Calibration& theta,
                                       std::int64_t version) {
    std::vector<TrackedKeyframe> rest;
    if (followed) {
      rest.push_back(std::move(keyframes_.back()));
      keyframes_.pop_back();
    }
    std::vector<TrackedKeyframe> taken =
        std::exchange(keyframes_, std::move(rest));
    if (static_cast<int>(taken.size()) < options_.min_keyframes) {
      before_.reset();
      // Neighbours in index are joined only if they are so in time.
      if (!taken.empty()) ++index_;
      return std::nullopt;
    }
    const std::int64_t next_ns =
        followed && 1e-9 * static_cast<double>(keyframes_.front().t_ns -
                                               taken.back().t_ns) <=
                        options_.max_gap_s
            ? keyframes_.front().t_ns
            : taken.back().t_ns;
    OdometrySegment result;
    const MotionSegment tracks = Assemble(taken, next_ns);
    Calibration of_motion = theta;
    of_motion.imu1.reset();
    if (!before_ || !Continue(of_motion, tracks, &result)) {
      Begin(of_motion, tracks, &result);
    }
    if (has_second_imu_) {
      result.segment.imu1 =
          Readings(recording_->imu1(), taken.front().t_ns, next_ns);
    }
    result.segment.calibration_version = version;
    ++index_;
    if (next_ns == taken.back().t_ns) ++index_;
    return result;
  }

  MotionSegment Assemble(const std::vector<TrackedKeyframe>& keyframes,
                         std::int64_t next_ns) const {
    MotionSegment segment;
    segment.key = {options_.session, index_};
    segment.session_start_ns = reader_.session_start_ns();
    segment.temperature_c = options_.temperature_c;
    segment.imu = Readings(recording_->imu(), keyframes.front().t_ns, next_ns);
    std::map<std::uint64_t, int> seen;
    for (const TrackedKeyframe& keyframe : keyframes) {
      segment.keyframes.push_back({.t_ns = keyframe.t_ns});
      for (const TrackPoint& point : keyframe.points) ++seen[point.landmark];
    }
    std::map<std::uint64_t, int> index_of;
    for (const auto& [landmark, observations] : seen) {
      if (observations < options_.min_observations) continue;
      index_of[landmark] = static_cast<int>(segment.landmarks.size());
      segment.landmarks.push_back({.id = IdIn(frame_, landmark)});
    }
    for (std::size_t k = 0; k < keyframes.size(); ++k) {
      for (const TrackPoint& point : keyframes[k].points) {
        const auto found = index_of.find(point.landmark);
        if (found == index_of.end()) continue;
        segment.observations.push_back({.keyframe = static_cast<int>(k),
                                        .camera = point.camera,
                                        .landmark = found->second,
                                        .z_px = point.z_px});
      }
    }
    return segment;
  }

  // The motion of a segment that follows another. False if none is found from
  // where that ended, which may be wrong.
  bool Continue(const Calibration& theta,
                const MotionSegment& tracks,
                OdometrySegment* result) {
    const KeyframeState first = CarryOn(rig_,
                                        ThetaAt(theta, options_),
                                        before_->keyframes.back(),
                                        before_->imu,
                                        tracks.keyframes.front().t_ns);
    return Find(theta, {first.b_a, first.b_g, first}, tracks, result);
  }

  // The motion of a segment in a frame of its own. Its index and the ids of its
  // landmarks keep it apart from those before it.
  void Begin(const Calibration& theta,
             MotionSegment tracks,
             OdometrySegment* result) {
    if (index_ > options_.first_index) tracks.key.index = ++index_;
    for (Landmark& landmark : tracks.landmarks) {
      landmark.id = IdIn(index_, landmark.id);
    }
    frame_ = index_;
    Find(theta, {}, tracks, result);
  }

  bool Find(const Calibration& theta,
            const MotionStart& start,
            const MotionSegment& tracks,
            OdometrySegment* result) {
    result->segment = tracks;
    const MotionEstimate estimate =
        EstimateMotion(rig_, theta, start, &result->segment);
    result->failure = estimate.failure;
    result->reprojection_rms_px = estimate.reprojection_rms_px;
    before_.reset();
    if (estimate.failure.empty()) before_ = result->segment;
    return before_.has_value();
  }

  // The id of a track in the frame that begins with a segment.
  static std::uint64_t IdIn(std::int64_t frame, std::uint64_t id) {
    return (static_cast<std::uint64_t>(frame) << 32) | (id & 0xffffffff);
  }

  Recording* recording_;
  const Rig rig_;  // without the second IMU
  const bool has_second_imu_;
  const OdometryOptions options_;
  KeyframeReader reader_;
  std::vector<TrackedKeyframe> keyframes_;
  std::int64_t index_;
  std::int64_t frame_ = 0;  // index of the segment with which G began
  std::optional<MotionSegment> before_;  // with its motion
};

Odometry::Odometry(Recording* recording,
                   const Rig& rig,
                   const Calibration& theta,
                   const OdometryOptions& options)
    : impl_(std::make_unique<Impl>(recording, rig, theta, options)) {}

Odometry::~Odometry() = default;

absl::StatusOr<std::optional<OdometrySegment>> Odometry::Next(
    const Calibration& theta, std::int64_t version) {
  return impl_->Next(theta, version);
}

const OdometryProgress& Odometry::progress() const { return impl_->progress(); }

}  // namespace selfcal::client
