#include "test/client/tracking/track_errors.h"

#include <algorithm>
#include <cmath>
#include <ctime>
#include <map>
#include <optional>
#include <tuple>
#include <utility>

namespace selfcal {
namespace {

double CpuSeconds() {
  return static_cast<double>(std::clock()) / CLOCKS_PER_SEC;
}

cv::Mat AsMat(GreyImage* image) {
  return {image->height_px, image->width_px, CV_8UC1, image->pixels.data()};
}

// Errors of the points of tracks, which come image by image.
class Judge {
 public:
  explicit Judge(const RenderedRecording& recording) : recording_(recording) {}

  TrackError Of(const client::TrackPoint& point) {
    TrackError error;
    error.point = point;
    const auto [hit, begins] = hits_.try_emplace(point.landmark);
    if (begins) {
      hit->second = recording_.SurfaceAt(point.camera, point.image, point.z_px);
    }
    error.first = begins;
    const auto [born, is_new] =
        born_.try_emplace(std::pair(point.camera, point.landmark), point.image);
    error.age = point.image - born->second;
    Eigen::Vector2d truth;
    error.in_view =
        hit->second &&
        recording_.TruePixel(point.camera, point.image, *hit->second, &truth);
    if (!error.in_view) return error;
    error.error_px = point.z_px - truth;
    error.moving = recording_.scene().Surface(hit->second->surface).moves();
    return error;
  }

 private:
  const RenderedRecording& recording_;
  std::map<std::uint64_t, std::optional<Hit>> hits_;
  std::map<std::pair<int, std::uint64_t>, int> born_;
};

bool IsOutlier(const TrackError& error) {
  return !error.in_view || error.error_px.norm() > kOutlier_px;
}

}  // namespace

TrackedRecording TrackRecording(const RenderedRecording& recording,
                                const Calibration& theta,
                                const client::TrackerOptions& options,
                                int images) {
  client::FeatureTracker tracker(theta, options);
  Judge judge(recording);
  TrackedRecording tracked;
  std::size_t reading = 0;
  const std::vector<ImuSample>& imu = recording.imu().measured;
  double cpu_s = 0;
  images = std::min(images, recording.images());
  for (int k = 0; k < images; ++k) {
    std::vector<GreyImage> rendered;
    std::vector<cv::Mat> mats;
    for (int j = 0; j < recording.cameras(); ++j) {
      rendered.push_back(recording.Image(j, k));
    }
    for (GreyImage& image : rendered) mats.push_back(AsMat(&image));
    // All readings of the next 100 ms are there when the images are.
    const double begin_s = CpuSeconds();
    while (reading < imu.size() &&
           imu[reading].t_ns <= recording.stamp_ns(k) + 100'000'000) {
      tracker.AddImu(imu[reading++]);
    }
    const auto points = tracker.Track(recording.stamp_ns(k), mats);
    if (k > 0) cpu_s += CpuSeconds() - begin_s;
    tracked.counts.push_back(tracker.counts());
    for (const client::TrackPoint& point : points) {
      tracked.errors.push_back(judge.Of(point));
    }
  }
  tracked.cpu_ms = images > 1 ? 1e3 * cpu_s / (images - 1) : 0;
  return tracked;
}

ErrorStatistics Summarise(const TrackedRecording& tracked) {
  ErrorStatistics statistics;
  std::vector<double> distances;
  std::map<std::pair<int, std::uint64_t>, Eigen::Vector2d> last;
  int moving = 0;
  int outliers = 0;
  double products = 0;
  double squares_a = 0;
  double squares_b = 0;
  for (const TrackError& error : tracked.errors) {
    moving += error.moving;
    const std::pair key(error.point.camera, error.point.landmark);
    if (error.first) {
      last[key].setZero();
      continue;
    }
    ++statistics.points;
    if (IsOutlier(error)) {
      ++outliers;
      last.erase(key);
      continue;
    }
    distances.push_back(error.error_px.norm());
    const auto before = last.find(key);
    if (before != last.end() && error.age > 1) {
      products += before->second.dot(error.error_px);
      squares_a += before->second.squaredNorm();
      squares_b += error.error_px.squaredNorm();
    }
    last[key] = error.error_px;
  }
  if (distances.empty()) return statistics;
  const auto total = static_cast<double>(tracked.errors.size());
  statistics.outlier_share = static_cast<double>(outliers) / statistics.points;
  statistics.moving_share = moving / total;
  std::map<std::pair<int, std::uint64_t>, int> lengths;
  for (const TrackError& error : tracked.errors) {
    ++lengths[{error.point.camera, error.point.landmark}];
  }
  statistics.mean_length = total / static_cast<double>(lengths.size());
  std::sort(distances.begin(), distances.end());
  const auto below = [&](std::size_t percent) {
    return distances[distances.size() * percent / 100];
  };
  statistics.median_px = below(50);
  statistics.p75_px = below(75);
  statistics.p90_px = below(90);
  statistics.p95_px = below(95);
  statistics.p99_px = below(99);
  double squares = 0;
  for (const double distance : distances) squares += distance * distance;
  statistics.sigma_px =
      std::sqrt(squares / (2 * static_cast<double>(distances.size())));
  statistics.correlation =
      squares_a > 0 ? products / std::sqrt(squares_a * squares_b) : 0;
  return statistics;
}

double CorrelationAfter(const TrackedRecording& tracked, int images) {
  std::map<std::tuple<int, std::uint64_t, int>, Eigen::Vector2d> good;
  for (const TrackError& error : tracked.errors) {
    if (error.first || !error.in_view ||
        error.error_px.norm() > kGoodPoint_px) {
      continue;
    }
    const client::TrackPoint& point = error.point;
    good[{point.camera, point.landmark, point.image}] = error.error_px;
  }
  double products = 0, squares_a = 0, squares_b = 0;
  for (const auto& [key, a] : good) {
    const auto& [camera, landmark, image] = key;
    const auto b = good.find({camera, landmark, image + images});
    if (b == good.end()) continue;
    products += a.dot(b->second);
    squares_a += a.squaredNorm();
    squares_b += b->second.squaredNorm();
  }
  return squares_a > 0 ? products / std::sqrt(squares_a * squares_b) : 0;
}

double SigmaAtAge(const TrackedRecording& tracked, int age) {
  constexpr int kFewest = 20;
  int points = 0;
  double squares = 0;
  for (const TrackError& error : tracked.errors) {
    if (error.first || error.age != age || IsOutlier(error)) continue;
    squares += error.error_px.squaredNorm();
    ++points;
  }
  return points < kFewest ? 0 : std::sqrt(squares / (2 * points));
}

}  // namespace selfcal
