#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "client/cli/commands.h"
#include "client/cli/device_data.h"
#include "client/cli/diagnosis_text.h"
#include "client/cli/error_lines.h"
#include "client/cli/progress.h"
#include "client/cli/temperature_option.h"
#include "client/cli/vi_map_input.h"
#include "client/selfcal/client.h"
#include "client/text/text.h"
#include "core/preflight/diagnose.h"
#include "proto/convert.h"
#include "proto/resource_names.h"
#include "selfcal/v1/segment.pb.h"

namespace selfcal::client {
namespace {

struct ImportOptions {
  std::string rig;
  ViMapInput map;
  std::optional<double> temperature_c;
  double timeout_s = 60;
};

v1::StreamSegmentsResponse ToResponse(const Acknowledgement& ack) {
  v1::StreamSegmentsResponse message;
  message.set_session(ack.key.session);
  message.set_index(ack.key.index);
  switch (ack.verdict) {
    case Acknowledgement::Verdict::kStored:
      message.set_verdict(v1::StreamSegmentsResponse::STORED);
      break;
    case Acknowledgement::Verdict::kDuplicate:
      message.set_verdict(v1::StreamSegmentsResponse::DUPLICATE);
      break;
    case Acknowledgement::Verdict::kRejected:
      message.set_verdict(v1::StreamSegmentsResponse::REJECTED);
      break;
  }
  message.set_observations_dropped(
      static_cast<std::int32_t>(ack.observations_dropped));
  message.set_readings_dropped(static_cast<std::int32_t>(ack.readings_dropped));
  for (const Violation& violation : ack.violations) {
    v1::FieldViolation* added = message.add_violations();
    added->set_field(violation.field);
    added->set_description(violation.message);
  }
  return message;
}

// Prints acknowledgements as they arrive, on the thread of the stream.
class Reporter {
 public:
  Reporter(const Context& context, std::size_t total)
      : context_(context), total_(total), progress_("import") {
    progress_.Show(0, total_, "");
  }

  void Report(const Acknowledgement& ack) {
    const std::lock_guard lock(mutex_);
    ++done_;
    if (ack.verdict == Acknowledgement::Verdict::kRejected) Complain(ack);
    const v1::StreamSegmentsResponse message = ToResponse(ack);
    if (context_.json) {
      context_.PrintJson(message, true);
    } else if (!context_.terminal) {
      PrintText(fmt::format(
          "{}\t{}\t{}\n",
          ack.key.session,
          ack.key.index,
          v1::StreamSegmentsResponse::Verdict_Name(message.verdict())));
    }
    progress_.Show(done_, total_, "");
  }

  std::size_t done() const {
    const std::lock_guard lock(mutex_);
    return done_;
  }

  void Finish() {
    const std::lock_guard lock(mutex_);
    progress_.Clear();
    if (not_shown_ == 0) return;
    PrintError(fmt::format("and {} more {} rejected: {} in all",
                           not_shown_,
                           not_shown_ == 1 ? "segment was" : "segments were",
                           rejected_));
  }

 private:
  // Prints errors until they fill a screen.
  void Complain(const Acknowledgement& ack) {
    ++rejected_;
    if (lines_ >= kMostErrorLines) {
      ++not_shown_;
      return;
    }
    progress_.Clear();
    const std::string text = fmt::format("segment {}~{} was rejected:{}",
                                         ack.key.session,
                                         ack.key.index,
                                         ErrorLines(ack.violations));
    lines_ += 1 + static_cast<std::size_t>(
                      std::count(text.begin(), text.end(), '\n'));
    PrintError(text);
  }

  const Context& context_;
  const std::size_t total_;
  mutable std::mutex mutex_;  // guards all below
  std::size_t done_ = 0;
  std::size_t rejected_ = 0;
  std::size_t not_shown_ = 0;  // of the rejected
  std::size_t lines_ = 0;      // of errors
  Progress progress_;
};

// Warns about likely mistakes, but does not prevent sending: the user may know
// better.
void WarnBeforeSending(Context* context,
                       const v1::Rig& message,
                       const ImportOptions& options,
                       const std::vector<MotionSegment>& segments) {
  Rig rig;
  if (!FromProto(message, "", &rig).empty()) return;
  const auto theta =
      ReadVersion(context, rig, options.map.builder.calibration_version);
  if (theta) WarnOf(Diagnose(rig, *theta, segments));
}

// Waits as long as acknowledgements keep arriving.
absl::Status DrainPatiently(SegmentStream* stream,
                            const Reporter& reporter,
                            std::chrono::milliseconds patience) {
  while (true) {
    const std::size_t before = reporter.done();
    const absl::Status status = stream->Drain(patience);
    if (!absl::IsDeadlineExceeded(status) || reporter.done() == before) {
      return status;
    }
  }
}

// A stream keeps retrying what the daemon may accept later, such as a segment
// beyond a quota. After the timeout, the last error of the connection therefore
// decides whether the daemon refused the segments or did not answer.
grpc::StatusCode CodeOf(const absl::Status& drained,
                        const absl::Status& connection) {
  if (!absl::IsDeadlineExceeded(drained)) {
    return static_cast<grpc::StatusCode>(drained.code());
  }
  return connection.ok() ? grpc::StatusCode::UNAVAILABLE
                         : static_cast<grpc::StatusCode>(connection.code());
}

int SendSegments(Context* context,
                 const ImportOptions& options,
                 std::vector<MotionSegment> segments) {
  ClientOptions client = context->Connection();
  client.rig = options.rig;
  client.max_queue = static_cast<int>(segments.size());
  client.max_backoff = std::chrono::seconds(1);
  Reporter reporter(*context, segments.size());
  SegmentStream stream(
      client, [&](const Acknowledgement& ack) { reporter.Report(ack); });
  for (MotionSegment& segment : segments) stream.Send(std::move(segment));
  const absl::Status status =
      DrainPatiently(&stream,
                     reporter,
                     std::chrono::milliseconds(
                         static_cast<std::int64_t>(options.timeout_s * 1e3)));
  reporter.Finish();
  if (!status.ok()) {
    return Fail(
        *context,
        {CodeOf(status, stream.connection_status()),
         std::string(status.message().data(), status.message().size())});
  }
  const StreamStatistics statistics = stream.statistics();
  if (context->terminal && !context->json) {
    PrintText(fmt::format("{}: {} stored, {} duplicate, {} rejected\n",
                          CountText(statistics.queued, "segment"),
                          statistics.stored,
                          statistics.duplicates,
                          statistics.rejected));
  }
  return statistics.rejected == 0 ? kDone : kFailed;
}

// A folder in place of the rig is a mistake, unless there is such a rig, too.
absl::Status CheckOrder(const ImportOptions& options) {
  namespace fs = std::filesystem;
  std::error_code error;
  const std::string& folder = options.map.folders.front();
  if (!fs::is_directory(options.rig, error) || fs::exists(folder, error)) {
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(
      fmt::format("'{}' is a folder, and '{}' is none: the rig comes first\n"
                  "  selfcal segment import {} {}",
                  options.rig,
                  folder,
                  folder,
                  options.rig));
}

int Import(Context* context, const ImportOptions& options) {
  const absl::Status ordered = CheckOrder(options);
  if (!ordered.ok()) return FailInput(ordered);
  auto map = ReadViMapSegments(options.map);
  if (!map.ok()) return FailInput(map.status());
  for (MotionSegment& segment : map->segments) {
    segment.temperature_c = options.temperature_c;
  }
  // Fails at once if the rig does not exist; the stream would only report it
  // later.
  v1::Rig rig;
  const grpc::Status found = ReadDevice(context, options.rig, &rig);
  if (!found.ok()) return Fail(*context, found);
  WarnBeforeSending(context, rig, options, map->segments);
  return SendSegments(context, options, std::move(map->segments));
}

}  // namespace

CLI::App* AddImport(CLI::App* parent,
                    const std::string& name,
                    Context* context) {
  CLI::App* command = parent->add_subcommand(
      name,
      "Cut maplab VI-maps into segments and send them; returns when all are "
      "acknowledged");
  const auto options = std::make_shared<ImportOptions>();
  SegmentBuilderOptions& builder = options->map.builder;
  command->add_option("RIG", options->rig)->required();
  AddViMapOptions(command, &options->map);
  command->add_option(
      "--session", builder.session, "Name of the session [the mission's id]");
  command
      ->add_option("--calibration-version",
                   builder.calibration_version,
                   "The version with which the map was estimated")
      ->capture_default_str();
  AddTemperature(command,
                 "Temperature of the device during the recording",
                 &options->temperature_c);
  command
      ->add_option("--timeout",
                   options->timeout_s,
                   "Give up after this long without an acknowledgement [s]")
      ->check(CLI::Range(0.001, 1e6))
      ->capture_default_str();
  command->callback([context, options] {
    context->command = [context, options] { return Import(context, *options); };
  });
  return command;
}

}  // namespace selfcal::client
