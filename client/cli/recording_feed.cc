#include "client/cli/recording_feed.h"

#include <fmt/format.h>

#include <chrono>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <utility>

#include "client/cli/clock_alignment.h"
#include "client/cli/device_data.h"
#include "client/cli/error_lines.h"
#include "client/cli/progress.h"
#include "client/cli/run_following.h"
#include "client/odometry/odometry.h"
#include "client/selfcal/client.h"
#include "proto/resource_names.h"
#include "selfcal/v1/recalibration.grpc.pb.h"
#include "selfcal/v1/segment.grpc.pb.h"

namespace selfcal::client {
namespace {

using SegmentService = v1::SegmentService::StubInterface;
using RecalibrationService = v1::RecalibrationService::StubInterface;

constexpr std::chrono::milliseconds kPollEvery{20};
constexpr std::chrono::seconds kAcknowledgement{60};

// Position in a session, for its progress bar.
struct Place {
  std::size_t done = 0;
  std::size_t of = 0;
  const char* unit = "";
};

class Feed {
 public:
  Feed(Context* context,
       const std::string& rig,
       const RecordingsInput& input,
       RecordedSession* session,
       FeedCounts* counts)
      : context_(context),
        rig_(rig),
        input_(input),
        session_(session),
        counts_(counts),
        segments_(v1::SegmentService::NewStub(context->Channel())),
        runs_(v1::RecalibrationService::NewStub(context->Channel())),
        progress_(session->name),
        stream_(Connection(),
                [this](const Acknowledgement& ack) { OnAck(ack); }) {}

  int Run() {
    DeviceVersion active;
    v1::Segment last;
    grpc::Status status = ReadActive(&active);
    if (status.ok()) {
      status =
          ReadNewestSegment(context_,
                            rig_,
                            fmt::format("session = \"{}\"", session_->name),
                            &last);
    }
    if (!status.ok()) return Fail(*context_, status);
    const auto cameras = static_cast<std::size_t>(CameraCount(*session_));
    if (active.rig.factory.cameras.size() != cameras) {
      return FailInput(absl::InvalidArgumentError(
          fmt::format("the recording has {} cameras and the rig '{}' has {}; "
                      "name the topics of its cameras with --camera-topic, or "
                      "choose cameras of the calibration with --cameras",
                      cameras,
                      rig_,
                      active.rig.factory.cameras.size())));
    }
    const absl::Status imus =
        CheckImus(*session_, active.rig.factory.imu1.has_value());
    if (!imus.ok()) return FailInput(imus);
    const auto name = ParseSegmentName(last.name());
    counts_->continued = counts_->continued || name;
    return session_->map ? SendMap(name ? name->key.index : -1)
                         : Track(std::move(active), last);
  }

 private:
  // Sends the segments of a map that come after that with the index `last`.
  int SendMap(std::int64_t last) {
    const std::vector<MotionSegment>& all = session_->map->segments;
    for (std::size_t i = 0; i < all.size(); ++i) {
      if (all[i].key.index <= last) continue;
      const Place place = {i + 1, all.size(), "segments"};
      Show(place, "");
      if (const int code = Take(all[i], place); code != kDone) return code;
    }
    progress_.Clear();
    return kDone;
  }

  // Tracks what comes after the segment `last`.
  int Track(DeviceVersion active, const v1::Segment& last) {
    if (!active.rig.factory.imu1 && !session_->recording->imu1().empty()) {
      PrintError(
          fmt::format("{}: the readings of the second IMU are not used: the "
                      "rig has one IMU",
                      session_->name));
    }
    const absl::Status aligned = AlignClocks(active.theta, {}, session_);
    if (!aligned.ok()) return FailInput(aligned);
    OdometryOptions odometry{.session = session_->name,
                             .keyframe_rate_hz = input_.keyframe_rate_hz,
                             .keyframes = input_.keyframes,
                             .temperature_c = input_.temperature_c};
    if (const auto name = ParseSegmentName(last.name())) {
      // Not joined to the segment before: its motion is not known here.
      odometry.first_index = name->key.index + 2;
      odometry.after_ns = last.end_ns();
    }
    Odometry source(
        session_->recording.get(), active.rig, active.theta, odometry);
    for (;;) {
      auto next = source.Next(active.theta, active.message.version());
      if (!next.ok()) return FailInput(next.status());
      if (!*next) break;
      const Place place = {
          source.progress().images, source.progress().of, "images"};
      Show(place, "");
      if (!(*next)->failure.empty()) {
        Leave((*next)->segment.key, (*next)->failure);
      } else if (const int code = Take((*next)->segment, place);
                 code != kDone) {
        return code;
      }
      const grpc::Status status = ReadActive(&active);
      if (!status.ok()) return Fail(*context_, status);
    }
    const OdometryProgress& end = source.progress();
    progress_.Clear();
    if (end.unreadable > 0) {
      PrintError(fmt::format("{}: {} images could not be read, e.g. {}",
                             session_->name,
                             end.unreadable,
                             end.last_error));
    }
    return kDone;
  }

  ClientOptions Connection() const {
    ClientOptions client = context_->Connection();
    client.rig = rig_;
    client.max_backoff = std::chrono::seconds(1);
    return client;
  }

  void Show(const Place& at, const std::string& note) {
    progress_.Show(
        at.done,
        at.of,
        fmt::format("{}, {} segments{}", at.unit, counts_->sent, note));
  }

  grpc::Status ReadActive(DeviceVersion* active) {
    return ReadDeviceVersion(context_, rig_, "active", active);
  }

  // Sends a segment and waits for what the daemon does with it.
  int Take(const MotionSegment& segment, const Place& at) {
    if (!stream_.Send(segment)) {
      return FailInput(absl::ResourceExhaustedError(
          "the segment cannot be sent: the queue is full"));
    }
    const absl::Status drained = stream_.Drain(kAcknowledgement);
    if (!drained.ok()) {
      const absl::Status connection = stream_.connection_status();
      return Fail(
          *context_,
          {connection.ok() ? grpc::StatusCode::UNAVAILABLE
                           : static_cast<grpc::StatusCode>(connection.code()),
           std::string(connection.ok() ? drained.message()
                                       : connection.message())});
    }
    if (const std::string reason = TakeRejection(); !reason.empty()) {
      Leave(segment.key, reason);
      return kDone;
    }
    ++counts_->sent;
    Show(at, "");
    grpc::Status status = WaitForScore(segment.key);
    if (status.ok()) status = WaitForRun(at);
    return status.ok() ? kDone : Fail(*context_, status);
  }

  void Leave(const SegmentKey& key, const std::string& reason) {
    ++counts_->failed;
    progress_.Clear();
    PrintError(fmt::format(
        "segment {}~{} is left out: {}", key.session, key.index, reason));
  }

  grpc::Status WaitForScore(const SegmentKey& key) {
    v1::GetSegmentRequest request;
    request.set_name(SegmentName(rig_, key));
    for (;;) {
      v1::Segment segment;
      const grpc::Status status = Call<SegmentService>(
          segments_.get(), &SegmentService::GetSegment, request, &segment);
      if (!status.ok() || segment.state() != v1::Segment::STORED) {
        return status;
      }
      std::this_thread::sleep_for(kPollEvery);
    }
  }

  grpc::Status WaitForRun(const Place& at) {
    for (;;) {
      v1::Recalibration run;
      const grpc::Status status = ReadNewestRun(runs_.get(), rig_, &run);
      if (!status.ok() || run.name().empty() || HasEnded(run)) return status;
      Show(at, ", calibrating");
      std::this_thread::sleep_for(kPollEvery);
    }
  }

  // Called on the thread of the stream.
  void OnAck(const Acknowledgement& ack) {
    if (ack.verdict != Acknowledgement::Verdict::kRejected) return;
    const std::lock_guard lock(mutex_);
    rejection_ = "the daemon rejected it:" + ErrorLines(ack.violations);
  }

  std::string TakeRejection() {
    const std::lock_guard lock(mutex_);
    return std::exchange(rejection_, "");
  }

  Context* context_;
  const std::string rig_;
  const RecordingsInput& input_;
  RecordedSession* const session_;
  FeedCounts* counts_;
  const std::unique_ptr<SegmentService> segments_;
  const std::unique_ptr<RecalibrationService> runs_;
  Progress progress_;
  std::mutex mutex_;
  std::string rejection_;  // of the last segment; guarded by mutex_
  SegmentStream stream_;
};

}  // namespace

int FeedRecording(Context* context,
                  const std::string& rig,
                  const RecordingsInput& input,
                  RecordedSession* session,
                  FeedCounts* counts) {
  return Feed(context, rig, input, session, counts).Run();
}

}  // namespace selfcal::client
