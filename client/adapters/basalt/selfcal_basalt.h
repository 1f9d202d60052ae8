// Connects Basalt's visual-inertial odometry to selfcald: it streams Basalt's
// states, tracks and IMU readings as motion segments, and applies each
// calibration that becomes active while the odometry runs.
//
// Licence: Apache-2.0. The file includes headers of Basalt, which is under the
// 3-clause BSD licence: whoever gives a program that is built from both to
// others includes the notice of that licence.
//
// Requirements: Basalt is built without changes. The rig must have cameras of
// the models equidistant, double-sphere, extended-unified or radial-tangential,
// without rolling shutter, which take their images together, with one time
// offset for all; its IMU must have no g-sensitivity and no position of the
// accelerometer. Images and readings are given as they were measured: Basalt's
// odometry does not apply a time offset, the adapter does.
//
// Applying a version: Basalt's optical flow and estimator copy the calibration
// when they are constructed. The adapter ends both, constructs new ones with
// the new calibration, and begins them with the pose, the velocity and the
// biases of the newest state. The images from that state on, and their
// readings, are processed again, so that none is lost. The window of the
// estimator with its landmarks and its prior are lost, and the tracks begin
// anew.
//
//   selfcal::basalt::Adapter adapter(client, options, config, calibration);
//   adapter.WaitForCalibration(std::chrono::seconds(5));
//   for each reading:        adapter.AddReading(reading);
//   for each set of images:  adapter.AddImages(images);
//
// Threads: AddReading may be called from another thread than the rest. It and
// AddImages wait while Basalt's queues are full. on_output is called by
// AddImages and Finish.
#pragma once

#include <basalt/imu/imu_types.h>
#include <basalt/optical_flow/optical_flow.h>
#include <basalt/utils/vio_config.h>

#include <Eigen/Core>
#include <algorithm>
#include <basalt/calibration/calibration.hpp>
#include <chrono>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <selfcal/selfcal.hpp>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "basalt_calibration.h"
#include "basalt_odometry.h"

namespace selfcal {
namespace basalt {

struct Options {
  // Name of this run of the odometry; a new one for each start of the process.
  std::string session;
  double keyframe_rate_hz = 10;
  double pixel_sigma_px = 0.5;  // of a tracked point
  double gravity_mps2 = 9.81;
  bool use_double = false;  // the estimator's scalars, as for basalt_vio
  // Basalt states no covariance: its states are trusted this long after it has
  // begun, with a version or at all.
  double settling_s = 2;
  // The odometry is not to be trusted beyond these: its segments are dropped.
  double max_speed_mps = 20;
  double max_gyro_bias_rps = 0.5;
  double max_accel_bias_mps2 = 3;
  // Called with Basalt's output for each set of images, in their order.
  std::function<void(const Output&)> on_output;
};

class Adapter {
 public:
  // `calibration` is what Basalt uses until a version is applied. Its noise,
  // rate and vignette stay. Throws selfcal::Error for invalid options.
  Adapter(const ClientOptions& client,
          const Options& options,
          const ::basalt::VioConfig& config,
          const BasaltCalibration& calibration,
          Stream::AckCallback on_ack = Stream::AckCallback())
      : options_(options),
        config_(config),
        builder_(BuilderOptionsOf(options)),
        stream_(client, std::move(on_ack)),
        watch_(client),
        used_(calibration),
        odometry_(NewOdometry()) {
    odometry_->Begin();
  }

  // Waits for the active calibration and applies it; call it before the first
  // image. Returns false if the daemon has not answered in time, or if Basalt
  // cannot use the calibration (problem()): the odometry goes on with its own,
  // and nothing is sent before a version is applied.
  bool WaitForCalibration(std::chrono::milliseconds timeout) {
    const auto end = std::chrono::steady_clock::now() + timeout;
    while (!watch_.Newest() && std::chrono::steady_clock::now() < end) {
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    return ApplyNewest();
  }

  // Call it with every reading, as it was measured.
  void AddReading(const Reading& reading) {
    std::shared_ptr<Odometry> odometry;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      ImuSample sample;
      sample.t_ns = reading.t_ns;
      Copy(reading.gyro, sample.gyro);
      Copy(reading.accel, sample.accel);
      builder_.AddImu(sample);
      SendComplete();
      readings_.push_back(reading);
      odometry = odometry_;
    }
    // Not under the lock, as it may wait for images.
    odometry->AddReading(reading);
  }

  // Call it with every set of images, whose t_ns is that of the camera's clock.
  // Returns true if a calibration was applied.
  bool AddImages(const Images& images) {
    waiting_.push_back({images.t_ns, images.img_data});
    Feed(waiting_.back());
    TakeOutput();
    const Calibration newest = watch_.Newest();
    return newest && newest.version() != version_ && ApplyNewest();
  }

  // Waits until Basalt has processed all images, ends the last segment and
  // waits until the daemon has all of them.
  Status Finish(std::chrono::milliseconds timeout) {
    const auto end = std::chrono::steady_clock::now() + timeout;
    TakeOutput();
    while (IsBusy() && std::chrono::steady_clock::now() < end) {
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
      TakeOutput();
    }
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      builder_.Flush(kMinKeyframes);
      SendComplete();
    }
    return stream_.Drain(timeout);
  }

  // Version that Basalt estimates with; 0 before the first.
  std::int64_t version() const { return version_; }
  // The calibration of that version; empty before the first.
  const Calibration& calibration() const { return calibration_; }
  // Newest state, in the frames of that calibration, at the exposure.
  const std::optional<KeyframeState>& state() const { return state_; }
  // True if Basalt has settled since it has begun, and is plausible.
  bool healthy() const { return healthy_; }
  // Empty, or why the newest calibration was not applied.
  const std::string& problem() const { return problem_; }
  const Stream& stream() const { return stream_; }
  selfcal_builder_statistics statistics() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return builder_.statistics();
  }

 private:
  static constexpr std::int32_t kMinKeyframes = 10;  // of a last segment
  // Readings are kept this long before the newest state, as an offset that is
  // applied can move the state back.
  static constexpr std::int64_t kMargin_ns = 100'000'000;

  struct WaitingImages {
    std::int64_t t_ns = 0;  // on the camera's clock
    std::vector<::basalt::ImageData> images;
  };

  static BuilderOptions BuilderOptionsOf(const Options& options) {
    BuilderOptions session;
    session.session = options.session;
    session.gravity_mps2 = options.gravity_mps2;
    session.pixel_sigma_px = options.pixel_sigma_px;
    return session;
  }

  std::shared_ptr<Odometry> NewOdometry() const {
    return std::make_shared<Odometry>(
        config_,
        used_,
        Eigen::Vector3d(0, 0, -options_.gravity_mps2),
        options_.use_double);
  }

  bool ApplyNewest() {
    const Calibration newest = watch_.Newest();
    if (!newest) {
      problem_ = "the daemon has not answered";
      return false;
    }
    problem_ = NotExpressible(newest, used_.intrinsics.size());
    if (!problem_.empty()) return false;
    Apply(newest);
    return true;
  }

  void Apply(const Calibration& newest) {
    std::size_t fed = 0;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      fed = Exchange(newest);
    }
    // Images without readings yet, which may come from another thread.
    for (; fed < waiting_.size(); ++fed) Feed(waiting_[fed]);
  }

  // Returns the number of images that it has fed.
  std::size_t Exchange(const Calibration& newest) {
    odometry_->End();
    if (state_ && calibration_) CarryBiases(newest);
    calibration_ = newest;
    version_ = newest.version();
    frame_ = BodyFrameOf(newest.imu());
    used_ = BasaltCalibrationOf(newest, used_);
    first_track_ += tracks_;
    tracks_ = 0;
    begin_ns_.reset();
    builder_.Flush(kMinKeyframes);
    builder_.SetCalibrationVersion(version_);
    builder_.SetTheta(newest);
    SendComplete();
    odometry_ = NewOdometry();
    return Resume();
  }

  // The bias has taken up what the calibration got wrong.
  void CarryBiases(const Calibration& newest) {
    const Eigen::Vector3d rest = EigenOf(state_->q_GI).conjugate() *
                                 Eigen::Vector3d(0, 0, options_.gravity_mps2);
    double f_I[3];
    Copy(rest, f_I);
    newest.CarryBiases(calibration_, f_I, state_->b_g, state_->b_a);
  }

  // Begins with the newest state, and feeds what has come since. The state
  // holds at the exposure of its images, whose time the offset moves.
  std::size_t Resume() {
    if (state_ && !waiting_.empty() && IsPlausible(*state_)) {
      state_->t_ns = TimeOf(waiting_.front());
      odometry_->Begin(BasaltStateOf(*state_, frame_));
    } else {
      state_.reset();
      odometry_->Begin();
    }
    std::size_t fed = 0;
    for (const Reading& reading : readings_) {
      while (fed < waiting_.size() && TimeOf(waiting_[fed]) < reading.t_ns) {
        Feed(waiting_[fed++]);
      }
      odometry_->AddReading(reading);
    }
    return fed;
  }

  std::int64_t TimeOf(const WaitingImages& images) const {
    return images.t_ns + used_.cam_time_offset_ns;
  }

  void Feed(const WaitingImages& images) {
    odometry_->AddImages(TimeOf(images), images.images);
  }

  // Returns true while output is missing of images whose readings are there.
  bool IsBusy() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return std::any_of(
        waiting_.begin(), waiting_.end(), [this](const WaitingImages& images) {
          return (!state_ || state_->t_ns < TimeOf(images)) &&
                 !readings_.empty() && TimeOf(images) < readings_.back().t_ns;
        });
  }

  void TakeOutput() {
    Output output;
    while (odometry_->Take(&output)) {
      Use(output);
      if (options_.on_output) options_.on_output(output);
    }
  }

  void Use(const Output& output) {
    state_ = StateOf(*output.state, frame_);
    const std::int64_t image_t_ns = state_->t_ns - used_.cam_time_offset_ns;
    while (!waiting_.empty() && waiting_.front().t_ns < image_t_ns) {
      waiting_.pop_front();
    }
    if (!begin_ns_) begin_ns_ = state_->t_ns;
    healthy_ = state_->t_ns - *begin_ns_ >= Nanoseconds(options_.settling_s) &&
               IsPlausible(*state_);
    const std::lock_guard<std::mutex> lock(mutex_);
    while (!readings_.empty() &&
           readings_.front().t_ns < state_->t_ns - kMargin_ns) {
      readings_.pop_front();
    }
    if (version_ == 0) return;
    builder_.SetHealthy(healthy_);
    if (healthy_ && IsKeyframe(image_t_ns)) {
      builder_.AddKeyframe(*state_, image_t_ns, TracksOf(output));
      SendComplete();
    }
  }

  bool IsPlausible(const KeyframeState& state) const {
    // Comparisons with NaN are false.
    return EigenOf(state.q_GI).coeffs().allFinite() &&
           VectorOf(state.p_GI).allFinite() &&
           VectorOf(state.v_GI).norm() <= options_.max_speed_mps &&
           VectorOf(state.b_g).norm() <= options_.max_gyro_bias_rps &&
           VectorOf(state.b_a).norm() <= options_.max_accel_bias_mps2;
  }

  // Images are nearly periodic: a quarter of the interval is left for jitter.
  bool IsKeyframe(std::int64_t image_t_ns) {
    if (last_keyframe_ns_ &&
        image_t_ns - *last_keyframe_ns_ <
            Nanoseconds(0.75 / options_.keyframe_rate_hz)) {
      return false;
    }
    last_keyframe_ns_ = image_t_ns;
    return true;
  }

  // Basalt counts its tracks from 0 each time that it begins.
  std::vector<Observation> TracksOf(const Output& output) {
    std::vector<Observation> seen;
    const auto& cameras = output.view->opt_flow_res->observations;
    for (std::size_t i = 0; i < cameras.size(); ++i) {
      for (const auto& track : cameras[i]) {
        const Eigen::Vector2f pixel = track.second.translation();
        seen.push_back(ObservationOfTrack(first_track_ + track.first,
                                          static_cast<std::int32_t>(i),
                                          pixel.x(),
                                          pixel.y()));
        tracks_ = std::max<std::uint64_t>(tracks_, track.first + 1);
      }
    }
    return seen;
  }

  void SendComplete() {
    while (Segment segment = builder_.Take()) stream_.Send(std::move(segment));
  }

  const Options options_;
  const ::basalt::VioConfig config_;
  mutable std::mutex mutex_;  // guards builder_, readings_ and odometry_
  Builder builder_;
  Stream stream_;
  Watch watch_;
  std::deque<Reading, Eigen::aligned_allocator<Reading>> readings_;
  // Images from that of the newest state on.
  std::deque<WaitingImages> waiting_;
  Calibration calibration_;
  BodyFrame frame_;
  BasaltCalibration used_;
  std::int64_t version_ = 0;
  std::string problem_;
  std::optional<KeyframeState> state_;
  std::optional<std::int64_t> begin_ns_;  // first state since it has begun
  std::optional<std::int64_t> last_keyframe_ns_;
  bool healthy_ = false;
  std::uint64_t first_track_ = 0;
  std::uint64_t tracks_ = 0;
  std::shared_ptr<Odometry> odometry_;
};

}  // namespace basalt
}  // namespace selfcal
