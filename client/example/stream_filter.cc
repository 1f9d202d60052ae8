// Streams what a filter or a smoother delivers, which differs from
// stream_recording.cc in four points:
//
//  - Its tracks have no positions: the library triangulates them.
//  - Its states come late, and hold at the exposure.
//  - Its camera has a clock of its own, with an offset that is known roughly.
//  - It takes a version that becomes active while it runs.
//
//   stream_filter TARGET RIG DIR CLOCK_OFFSET_S [PACE]
//
// recording.h describes the files in DIR, from which the filter below takes
// what it delivers; the exit code is that of stream_recording.cc.
// CLOCK_OFFSET_S is what the camera's clock is ahead of the IMU's. With PACE it
// takes that many times as long as the recording, instead of no time.
#include <selfcal/client.h>
#include <selfcal/model/imu.h>
#include <selfcal/segment_builder.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <deque>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "recording.h"

namespace {

namespace sc = selfcal::client;

// The filter's output for one image.
struct FilterOutput {
  std::int64_t camera_stamp_ns = 0;  // on the camera's clock
  selfcal::KeyframeState state;      // at the exposure, on the IMU's clock
  std::vector<sc::KeyframeObservation> tracks;  // p_G is not finite
};

// Stands for the filter: it estimates a state for each image, and delivers it
// when it leaves the window of the last kWindow images.
class Filter {
 public:
  static constexpr std::size_t kWindow = 5;

  explicit Filter(std::int64_t clock_offset_ns)
      : clock_offset_ns_(clock_offset_ns) {}

  // Exchanges the calibration: the biases of the newest state take over what
  // the new one corrects.
  void Use(const selfcal::Calibration& theta) {
    if (theta_ && !window_.empty()) {
      selfcal::KeyframeState& x = window_.back().state;
      const selfcal::ImuBiases carried =
          selfcal::CarryBiases(theta_->imu,
                               theta.imu,
                               x.q_GI.inverse() * Eigen::Vector3d(0, 0, 9.81),
                               {x.b_g, x.b_a});
      x.b_g = carried.b_g;
      x.b_a = carried.b_a;
    }
    theta_ = theta;
  }

  // Takes the estimate of a state at the stamp of an image.
  void Add(const selfcal::KeyframeState& state,
           std::vector<sc::KeyframeObservation> tracks) {
    for (sc::KeyframeObservation& track : tracks) {
      track.p_G.setConstant(std::nan(""));
    }
    window_.push_back(
        {state.t_ns + clock_offset_ns_, state, std::move(tracks)});
  }

  std::optional<FilterOutput> TakeOldest(std::size_t window = kWindow) {
    if (window_.size() <= window) return std::nullopt;
    FilterOutput oldest = std::move(window_.front());
    window_.pop_front();
    return oldest;
  }

  const std::optional<selfcal::Calibration>& theta() const { return theta_; }

 private:
  const std::int64_t clock_offset_ns_;
  std::optional<selfcal::Calibration> theta_;
  std::deque<FilterOutput> window_;
};

// The newest version, from the thread of the watch to that of the filter.
class NewestVersion {
 public:
  void Put(const sc::CalibrationVersion& version) {
    const std::lock_guard lock(mutex_);
    newest_ = version;
  }
  // Each version once.
  std::optional<sc::CalibrationVersion> Take() {
    const std::lock_guard lock(mutex_);
    return std::exchange(newest_, std::nullopt);
  }

 private:
  std::mutex mutex_;
  std::optional<sc::CalibrationVersion> newest_;
};

// Feeds what the filter delivers to the builder.
class Feed {
 public:
  Feed(const sc::ClientOptions& options,
       Filter* filter,
       std::int64_t clock_offset_ns)
      : filter_(filter),
        clock_offset_ns_(clock_offset_ns),
        builder_({.session = "filter"}),
        stream_(options, nullptr),
        watch_(options, [this](const sc::CalibrationVersion& version) {
          newest_.Put(version);
        }) {}

  void AddImu(const selfcal::ImuSample& sample) { builder_.AddImu(sample); }

  // Between two images the filter takes a version that has become active. What
  // it delivers from then on is estimated with it; what is in its window is
  // nearly so, and counted to it: states are only where an estimate begins.
  void TakeNewVersion() {
    const auto version = newest_.Take();
    if (!version) return;
    filter_->Use(version->theta);
    builder_.SetCalibrationVersion(version->version);
    builder_.SetTheta(version->theta);
    std::printf("version %lld is applied, focal length %.2f px\n",
                static_cast<long long>(version->version),
                version->theta.cameras.front().f.x());
  }

  // The stamps of a segment are those of one clock: the offset that is known is
  // subtracted, and what is left of it is the time offset of the camera, which
  // the rig estimates (block cam0.time_offset).
  void AddOutput(const FilterOutput& output) {
    builder_.AddKeyframe(
        output.state, output.camera_stamp_ns - clock_offset_ns_, output.tracks);
    while (auto closed = builder_.TakeClosed()) {
      // A recording can wait; a filter would go on.
      if (stream_.statistics().queued >= 8) {
        if (!stream_.Drain(std::chrono::seconds(30)).ok()) return;
      }
      stream_.Send(*std::move(closed));
    }
  }

  bool has_version() const { return filter_->theta().has_value(); }

  int Finish() {
    builder_.Flush(/*min_keyframes=*/10);
    while (auto closed = builder_.TakeClosed()) {
      stream_.Send(*std::move(closed));
    }
    const absl::Status end = stream_.Drain(std::chrono::seconds(30));
    const sc::StreamStatistics s = stream_.statistics();
    std::printf(
        "segments: %llu stored, %llu rejected; tracks: %llu triangulated, %llu "
        "dropped\n",
        static_cast<unsigned long long>(s.stored),
        static_cast<unsigned long long>(s.rejected),
        static_cast<unsigned long long>(s.tracks_triangulated),
        static_cast<unsigned long long>(s.tracks_dropped));
    if (!end.ok()) std::fprintf(stderr, "%s\n", end.ToString().c_str());
    return end.ok() && s.rejected == 0 && s.dropped == 0 ? 0 : 1;
  }

 private:
  Filter* const filter_;
  const std::int64_t clock_offset_ns_;
  sc::SegmentBuilder builder_;
  sc::SegmentStream stream_;
  NewestVersion newest_;
  sc::CalibrationWatch watch_;  // last: it may call back at once
};

}  // namespace

int main(int argc, char** argv) {
  if (argc != 5 && argc != 6) {
    std::fprintf(
        stderr, "usage: %s TARGET RIG DIR CLOCK_OFFSET_S [PACE]\n", argv[0]);
    return 2;
  }
  sc::ClientOptions options;
  options.target = argv[1];
  options.rig = argv[2];
  const std::int64_t clock_offset_ns = std::llround(1e9 * std::atof(argv[4]));
  const double pace = argc == 6 ? std::atof(argv[5]) : 0;
  Recording recording;
  if (!Read(argv[3], &recording)) return 2;

  Filter filter(clock_offset_ns);
  Feed feed(options, &filter, clock_offset_ns);
  for (int i = 0; i < 500 && !feed.has_version(); ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
    feed.TakeNewVersion();
  }
  if (!feed.has_version()) return 1;  // a filter would use its own calibration

  auto sample = recording.imu.begin();
  std::int64_t last_ns = recording.keyframes.front().t_ns;
  for (const selfcal::KeyframeState& state : recording.keyframes) {
    std::this_thread::sleep_for(std::chrono::nanoseconds(
        std::llround(pace * static_cast<double>(state.t_ns - last_ns))));
    last_ns = state.t_ns;
    for (; sample != recording.imu.end() && sample->t_ns <= state.t_ns;
         ++sample) {
      feed.AddImu(*sample);
    }
    feed.TakeNewVersion();
    filter.Add(state, recording.observations[state.t_ns]);
    while (const auto output = filter.TakeOldest()) feed.AddOutput(*output);
  }
  for (; sample != recording.imu.end(); ++sample) feed.AddImu(*sample);
  while (const auto output = filter.TakeOldest(0)) feed.AddOutput(*output);
  return feed.Finish();
}
