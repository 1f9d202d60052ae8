#include "client/odometry/keyframe_reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>
#include <utility>

#include "core/model/median.h"

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

}  // namespace

KeyframeReader::KeyframeReader(Recording* recording,
                               const Rig& rig,
                               const Calibration& theta,
                               const OdometryOptions& options)
    : recording_(recording),
      cameras_(rig.factory.cameras),
      has_second_imu_(rig.factory.imu1.has_value()),
      sets_(ImageSets(*recording)),
      step_(KeyframeStep(sets_, options.keyframe_rate_hz)),
      tracker_(theta, {.session_start_ns = SessionStart(sets_)}) {
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

std::optional<std::int64_t> KeyframeReader::session_start_ns() const {
  return SessionStart(sets_);
}

absl::StatusOr<std::optional<TrackedKeyframe>> KeyframeReader::Next() {
  const ImageSet& set = sets_[next_set_];
  std::optional<std::vector<TrackPoint>> points = RecordedPoints(set);
  if (!points) {
    auto followed = Follow(set);
    if (!followed.ok()) return followed.status();
    points = *std::move(followed);
  }
  progress_.images = next_set_ + 1;
  std::optional<TrackedKeyframe> keyframe;
  if (next_set_ % static_cast<std::size_t>(step_) == 0 && Covered(set.t_ns)) {
    keyframe = {set.t_ns, *std::move(points)};
  }
  ++next_set_;
  return keyframe;
}

std::optional<std::vector<TrackPoint>> KeyframeReader::RecordedPoints(
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

absl::Status KeyframeReader::ReadImages(const ImageSet& set,
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
    const CameraCalibration& camera = cameras_[j];
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

absl::StatusOr<std::vector<TrackPoint>> KeyframeReader::Follow(
    const ImageSet& set) {
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

bool KeyframeReader::Covered(std::int64_t t_ns) const {
  const auto covers = [&](const std::vector<ImuSample>& imu) {
    return !imu.empty() && imu.front().t_ns <= t_ns && t_ns <= imu.back().t_ns;
  };
  return covers(recording_->imu()) &&
         (!has_second_imu_ || covers(recording_->imu1()));
}

}  // namespace selfcal::client
