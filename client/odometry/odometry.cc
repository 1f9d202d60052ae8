#include "client/odometry/odometry.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <map>
#include <span>
#include <utility>
#include <vector>

#include "client/tracking/feature_tracker.h"
#include "core/model/median.h"
#include "core/model/temperature.h"
#include "core/motion/estimate_motion.h"

namespace selfcal::client {
namespace {

// Readings that the tracker needs about the last exposure of an image.
constexpr std::int64_t kTrackerLead_ns = 300'000'000;
constexpr std::size_t kMinUnreadable = 10;

// Every n-th stamp is a keyframe.
int KeyframeStep(const std::vector<ImageSet>& sets, double rate_hz) {
  if (sets.size() < 2) return 1;
  std::vector<std::int64_t> steps_ns;
  for (std::size_t i = 1; i < sets.size(); ++i) {
    steps_ns.push_back(sets[i].t_ns - sets[i - 1].t_ns);
  }
  const double step_s =
      1e-9 * static_cast<double>(UpperMedian(std::move(steps_ns)));
  // A tenth of a step less: stamps jitter.
  return std::max(1, static_cast<int>(std::ceil(1 / (rate_hz * step_s) - 0.1)));
}

std::optional<std::int64_t> SessionStart(const std::vector<ImageSet>& sets) {
  if (sets.empty()) return std::nullopt;
  return sets.front().t_ns;
}

struct Keyframe {
  std::int64_t t_ns = 0;
  std::vector<TrackPoint> points;
};

// The second IMU does not move the states: little may be known of its pose, and
// a calibration uses it.
Rig WithoutSecondImu(Rig rig) {
  rig.factory.imu1.reset();
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
        sets_(ImageSets(*recording)),
        step_(KeyframeStep(sets_, options.keyframe_rate_hz)),
        tracker_(ThetaAt(theta, options),
                 {.session_start_ns = SessionStart(sets_)}),
        index_(options.first_index) {
    if (options.after_ns) {
      next_set_ = static_cast<std::size_t>(
          std::upper_bound(sets_.begin(),
                           sets_.end(),
                           *options.after_ns,
                           [](std::int64_t t_ns, const ImageSet& set) {
                             return t_ns < set.t_ns;
                           }) -
          sets_.begin());
    }
    progress_.of = sets_.size();
    progress_.images = next_set_;
  }

  absl::StatusOr<std::optional<OdometrySegment>> Next(const Calibration& theta,
                                                      std::int64_t version) {
    for (;;) {
      const bool more = next_set_ < sets_.size();
      if (more) {
        const absl::Status read = ReadSet();
        if (!read.ok()) return read;
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

  const OdometryProgress& progress() const { return progress_; }

 private:
  bool GapBeforeLast() const {
    const std::int64_t gap_ns =
        keyframes_.back().t_ns - keyframes_[keyframes_.size() - 2].t_ns;
    return 1e-9 * static_cast<double>(gap_ns) > options_.max_gap_s;
  }

  // The points that the recording has instead of images; nullopt for one with
  // images.
  std::optional<std::vector<TrackPoint>> RecordedPoints(
      const ImageSet& set) const {
    std::optional<std::vector<TrackPoint>> points;
    for (int j = 0; j < static_cast<int>(set.images.size()); ++j) {
      if (set.images[j] < 0) continue;
      const auto* recorded = recording_->Points(j, set.images[j]);
      if (recorded == nullptr) return std::nullopt;
      if (!points) points.emplace();
      for (const RecordedPoint& point : *recorded) {
        points->push_back({.landmark = point.landmark,
                           .camera = j,
                           .image = static_cast<int>(next_set_),
                           .z_px = point.z_px});
      }
    }
    return points;
  }

  // Images that cannot be read stay empty, and are counted.
  absl::Status ReadImages(const ImageSet& set,
                          std::vector<GreyPixels>* pixels) {
    pixels->resize(set.images.size());
    for (std::size_t j = 0; j < set.images.size(); ++j) {
      if (set.images[j] < 0) continue;
      auto read = recording_->ReadImage(static_cast<int>(j), set.images[j]);
      if (!read.ok()) {
        ++progress_.unreadable;
        progress_.last_error = std::string(read.status().message());
        continue;
      }
      GreyPixels& image = (*pixels)[j];
      image = *std::move(read);
      const CameraCalibration& camera = rig_.factory.cameras[j];
      if (image.width_px != camera.width_px ||
          image.height_px != camera.height_px) {
        return absl::InvalidArgumentError(
            fmt::format("the images of {} have {} x {} px, while the "
                        "calibration is for {} x {} px",
                        recording_->cameras()[j].name,
                        image.width_px,
                        image.height_px,
                        camera.width_px,
                        camera.height_px));
      }
    }
    const std::size_t read = next_set_ + 1;
    if (progress_.unreadable >= kMinUnreadable &&
        2 * progress_.unreadable > read * recording_->cameras().size()) {
      return absl::DataLossError(
          fmt::format("most images cannot be read, the last one because: {}",
                      progress_.last_error));
    }
    return absl::OkStatus();
  }

  // Follows the tracks into the images of a set.
  absl::StatusOr<std::vector<TrackPoint>> Follow(const ImageSet& set) {
    std::vector<GreyPixels> pixels;
    const absl::Status status = ReadImages(set, &pixels);
    if (!status.ok()) return status;
    std::vector<cv::Mat> images(pixels.size());
    for (std::size_t j = 0; j < pixels.size(); ++j) {
      if (pixels[j].pixels.empty()) continue;
      images[j] = cv::Mat(pixels[j].height_px,
                          pixels[j].width_px,
                          CV_8UC1,
                          pixels[j].pixels.data());
    }
    const std::span<const ImuSample> imu = recording_->imu();
    for (; next_sample_ < imu.size() &&
           imu[next_sample_].t_ns <= set.t_ns + kTrackerLead_ns;
         ++next_sample_) {
      tracker_.AddImu(imu[next_sample_]);
    }
    return tracker_.Track(set.t_ns, images);
  }

  absl::Status ReadSet() {
    const ImageSet& set = sets_[next_set_];
    std::optional<std::vector<TrackPoint>> points = RecordedPoints(set);
    if (!points) {
      auto followed = Follow(set);
      if (!followed.ok()) return followed.status();
      points = *std::move(followed);
    }
    progress_.images = next_set_ + 1;
    if (next_set_ % static_cast<std::size_t>(step_) == 0 && Covered(set.t_ns)) {
      keyframes_.push_back({set.t_ns, *std::move(points)});
    }
    ++next_set_;
    return absl::OkStatus();
  }

  bool Covered(std::int64_t t_ns) const {
    const auto covers = [&](const std::vector<ImuSample>& imu) {
      return !imu.empty() && imu.front().t_ns <= t_ns &&
             t_ns <= imu.back().t_ns;
    };
    return covers(recording_->imu()) &&
           (!has_second_imu_ || covers(recording_->imu1()));
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
    std::vector<Keyframe> rest;
    if (followed) {
      rest.push_back(std::move(keyframes_.back()));
      keyframes_.pop_back();
    }
    std::vector<Keyframe> taken = std::exchange(keyframes_, std::move(rest));
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

  MotionSegment Assemble(const std::vector<Keyframe>& keyframes,
                         std::int64_t next_ns) const {
    MotionSegment segment;
    segment.key = {options_.session, index_};
    segment.session_start_ns = SessionStart(sets_);
    segment.temperature_c = options_.temperature_c;
    segment.imu = Readings(recording_->imu(), keyframes.front().t_ns, next_ns);
    std::map<std::uint64_t, int> seen;
    for (const Keyframe& keyframe : keyframes) {
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
  const std::vector<ImageSet> sets_;
  const int step_;
  FeatureTracker tracker_;
  OdometryProgress progress_;
  std::size_t next_set_ = 0;
  std::size_t next_sample_ = 0;
  std::vector<Keyframe> keyframes_;
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
