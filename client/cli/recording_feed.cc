#include "client/cli/recording_feed.h"

#include <fmt/format.h>

#include <chrono>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

#include "client/cli/device_data.h"
#include "client/cli/error_lines.h"
#include "client/cli/progress.h"
#include "client/odometry/odometry.h"
#include "client/selfcal/client.h"
#include "proto/convert.h"
#include "proto/resource_names.h"
#include "selfcal/v1/calibration_service.grpc.pb.h"
#include "selfcal/v1/recalibration.grpc.pb.h"
#include "selfcal/v1/segment.grpc.pb.h"

namespace selfcal::client {
namespace {

using SegmentService = v1::SegmentService::StubInterface;
using CalibrationService = v1::CalibrationService::StubInterface;
using RecalibrationService = v1::RecalibrationService::StubInterface;

constexpr std::chrono::milliseconds kPollEvery{20};
constexpr std::chrono::seconds kAcknowledgement{60};

struct ActiveVersion {
  std::int64_t version = 0;
  Calibration theta;
};

struct LastSegment {
  std::int64_t index = 0;
  std::int64_t end_ns = 0;
};

bool IsUnfinished(const v1::Recalibration& run) {
  return run.state() == v1::Recalibration::PENDING ||
         run.state() == v1::Recalibration::RUNNING;
}

grpc::Status Unreadable(const std::vector<Violation>& faults) {
  return {grpc::StatusCode::DATA_LOSS,
          fmt::format("the daemon's answer cannot be read: {} {}",
                      faults[0].field,
                      faults[0].message)};
}

class Feed {
 public:
  Feed(Context* context, const FeedOptions& options, FeedCounts* counts)
      : context_(context),
        options_(options),
        counts_(counts),
        segments_(v1::SegmentService::NewStub(context->Channel())),
        calibrations_(v1::CalibrationService::NewStub(context->Channel())),
        runs_(v1::RecalibrationService::NewStub(context->Channel())),
        progress_(options.session),
        stream_(Connection(),
                [this](const Acknowledgement& ack) { OnAck(ack); }) {}

  int Run(Recording* recording) {
    Rig rig;
    ActiveVersion active;
    std::optional<LastSegment> last;
    grpc::Status status = ReadRig(&rig);
    if (status.ok()) status = ReadActive(&active);
    if (status.ok()) status = FindLast(&last);
    if (!status.ok()) return Fail(*context_, status);
    if (rig.factory.cameras.size() != recording->cameras().size()) {
      return FailInput(absl::InvalidArgumentError(
          fmt::format("the recording has {} cameras and the rig '{}' has {}; "
                      "name the topics of its cameras with --camera-topic, or "
                      "choose cameras of the calibration with --cameras",
                      recording->cameras().size(),
                      options_.rig,
                      rig.factory.cameras.size())));
    }
    OdometryOptions odometry{.session = options_.session,
                             .keyframe_rate_hz = options_.keyframe_rate_hz,
                             .keyframes = options_.keyframes};
    if (last) {
      counts_->continued = true;
      // Not joined to the segment before: its motion is not known here.
      odometry.first_index = last->index + 2;
      odometry.after_ns = last->end_ns;
    }
    Odometry source(recording, rig, active.theta, odometry);
    for (;;) {
      auto next = source.Next(active.theta, active.version);
      if (!next.ok()) return FailInput(next.status());
      if (!*next) break;
      Show(source.progress(), "");
      if (const int code = Take(**next, source.progress()); code != kDone) {
        return code;
      }
      status = ReadActive(&active);
      if (!status.ok()) return Fail(*context_, status);
    }
    const OdometryProgress& end = source.progress();
    progress_.Clear();
    if (end.unreadable > 0) {
      PrintError(fmt::format("{}: {} images could not be read, e.g. {}",
                             options_.session,
                             end.unreadable,
                             end.last_error));
    }
    return kDone;
  }

 private:
  ClientOptions Connection() const {
    ClientOptions client = context_->Connection();
    client.rig = options_.rig;
    client.max_backoff = std::chrono::seconds(1);
    return client;
  }

  void Show(const OdometryProgress& at, const std::string& note) {
    progress_.Show(at.images,
                   at.of,
                   fmt::format("images, {} segments{}", counts_->sent, note));
  }

  grpc::Status ReadRig(Rig* rig) {
    v1::Rig message;
    const grpc::Status status = ReadDevice(context_, options_.rig, &message);
    if (!status.ok()) return status;
    const auto faults = FromProto(message, "rig", rig);
    return faults.empty() ? grpc::Status::OK : Unreadable(faults);
  }

  grpc::Status ReadActive(ActiveVersion* active) {
    v1::GetCalibrationRequest request;
    request.set_name(ChildName(options_.rig, "calibrations", "active"));
    v1::Calibration calibration;
    const grpc::Status status =
        Call<CalibrationService>(calibrations_.get(),
                                 &CalibrationService::GetCalibration,
                                 request,
                                 &calibration);
    if (!status.ok()) return status;
    active->version = calibration.version();
    const auto faults =
        FromProto(calibration.parameters(), "parameters", &active->theta);
    return faults.empty() ? grpc::Status::OK : Unreadable(faults);
  }

  grpc::Status FindLast(std::optional<LastSegment>* last) {
    v1::ListSegmentsRequest request;
    request.set_parent(RigName(options_.rig));
    request.set_filter(fmt::format("session = \"{}\"", options_.session));
    request.set_order_by("receive_time desc");
    request.set_view(v1::ListSegmentsRequest::BASIC);
    request.set_page_size(1);
    v1::ListSegmentsResponse listed;
    const grpc::Status status = Call<SegmentService>(
        segments_.get(), &SegmentService::ListSegments, request, &listed);
    if (!status.ok() || listed.segments().empty()) return status;
    const auto name = ParseSegmentName(listed.segments(0).name());
    if (name) *last = {name->key.index, listed.segments(0).end_ns()};
    return status;
  }

  // Sends a segment and waits for what the daemon does with it.
  int Take(const OdometrySegment& one, const OdometryProgress& at) {
    if (!one.failure.empty()) {
      Leave(one.segment.key, one.failure);
      return kDone;
    }
    if (!stream_.Send(one.segment)) {
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
      Leave(one.segment.key, reason);
      return kDone;
    }
    ++counts_->sent;
    Show(at, "");
    grpc::Status status = WaitForScore(one.segment.key);
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
    request.set_name(SegmentName(options_.rig, key));
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

  grpc::Status WaitForRun(const OdometryProgress& at) {
    v1::ListRecalibrationsRequest request;
    request.set_parent(RigName(options_.rig));
    request.set_page_size(1);
    for (;;) {
      v1::ListRecalibrationsResponse listed;
      const grpc::Status status =
          Call<RecalibrationService>(runs_.get(),
                                     &RecalibrationService::ListRecalibrations,
                                     request,
                                     &listed);
      if (!status.ok() || listed.recalibrations().empty() ||
          !IsUnfinished(listed.recalibrations(0))) {
        return status;
      }
      Show(at, ", calibrating");
      std::this_thread::sleep_for(kPollEvery);
    }
  }

  // On the thread of the stream.
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
  const FeedOptions options_;
  FeedCounts* counts_;
  const std::unique_ptr<SegmentService> segments_;
  const std::unique_ptr<CalibrationService> calibrations_;
  const std::unique_ptr<RecalibrationService> runs_;
  Progress progress_;
  std::mutex mutex_;
  std::string rejection_;  // of the last segment; guarded by mutex_
  SegmentStream stream_;
};

}  // namespace

int FeedRecording(Context* context,
                  const FeedOptions& options,
                  Recording* recording,
                  FeedCounts* counts) {
  return Feed(context, options, counts).Run(recording);
}

}  // namespace selfcal::client
