#include <fmt/format.h>

#include <chrono>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "client/cli/commands.h"
#include "client/cli/progress.h"
#include "client/import/vi_map.h"
#include "client/selfcal/client.h"
#include "proto/resource_names.h"
#include "selfcal/v1/rig.grpc.pb.h"
#include "selfcal/v1/segment.pb.h"

namespace selfcal::client {
namespace {

struct ImportOptions {
  std::string rig;
  std::vector<std::string> folders;
  SegmentBuilderOptions builder;
  std::optional<double> temperature_c;
  bool all_landmarks = false;
  double timeout_s = 60;
};

absl::StatusOr<std::vector<MotionSegment>> ReadSegments(
    const ImportOptions& options) {
  ViMapOptions map_options;
  map_options.good_landmarks_only = !options.all_landmarks;
  absl::StatusOr<ViMapRecording> recording =
      options.folders.size() == 1
          ? ReadViMap(options.folders.front(), map_options)
          : ReadViMaps(options.folders, map_options);
  if (!recording.ok()) return recording.status();
  SegmentBuilderOptions builder = options.builder;
  if (builder.session.empty()) builder.session = recording->session;
  std::vector<MotionSegment> segments = BuildSegments(*recording, builder);
  for (MotionSegment& segment : segments) {
    segment.temperature_c = options.temperature_c;
  }
  return segments;
}

v1::StreamSegmentsResponse ToMessage(const Acknowledgement& ack) {
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
  for (const Violation& violation : ack.violations) {
    v1::FieldViolation* added = message.add_violations();
    added->set_field(violation.field);
    added->set_description(violation.message);
  }
  return message;
}

// Prints acknowledgements as they come, on the thread of the stream.
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
    const v1::StreamSegmentsResponse message = ToMessage(ack);
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
  }

 private:
  void Complain(const Acknowledgement& ack) {
    progress_.Clear();
    std::string text = fmt::format(
        "segment {}~{} was rejected:", ack.key.session, ack.key.index);
    for (const Violation& violation : ack.violations) {
      text += fmt::format("\n  {}: {}", violation.field, violation.message);
    }
    PrintError(text);
  }

  const Context& context_;
  const std::size_t total_;
  mutable std::mutex mutex_;  // guards all below
  std::size_t done_ = 0;
  Progress progress_;
};

grpc::Status CheckRig(Context* context, const std::string& rig) {
  using Service = v1::RigService::StubInterface;
  const auto stub = v1::RigService::NewStub(context->Channel());
  v1::GetRigRequest request;
  request.set_name(RigName(rig));
  v1::Rig found;
  return Call<Service>(stub.get(), &Service::GetRig, request, &found);
}

// Waits as long as acknowledgements keep coming.
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

int Send(Context* context,
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
    const auto code = absl::IsDeadlineExceeded(status)
                          ? grpc::StatusCode::UNAVAILABLE
                          : static_cast<grpc::StatusCode>(status.code());
    return Fail(
        *context,
        {code, std::string(status.message().data(), status.message().size())});
  }
  const StreamStatistics statistics = stream.statistics();
  if (context->terminal && !context->json) {
    PrintText(
        fmt::format("{} segments: {} stored, {} already there, {} rejected\n",
                    statistics.queued,
                    statistics.stored,
                    statistics.duplicates,
                    statistics.rejected));
  }
  return statistics.rejected == 0 ? kDone : kFailed;
}

int Import(Context* context, const ImportOptions& options) {
  auto segments = ReadSegments(options);
  if (!segments.ok()) return FailInput(segments.status());
  if (segments->empty()) {
    return FailInput(absl::InvalidArgumentError(
        "the recording is too short for one segment; give fewer --keyframes"));
  }
  // Says at once what the stream would wait for.
  const grpc::Status found = CheckRig(context, options.rig);
  if (!found.ok()) return Fail(*context, found);
  return Send(context, options, *std::move(segments));
}

}  // namespace

void AddImportCommand(CLI::App* app, Context* context) {
  CLI::App* import = app->add_subcommand(
      "import",
      "Cut maplab VI-maps into segments and send them; returns when all are "
      "acknowledged");
  const auto options = std::make_shared<ImportOptions>();
  SegmentBuilderOptions& builder = options->builder;
  import->add_option("RIG", options->rig)->required();
  import
      ->add_option("DIR",
                   options->folders,
                   "A VI-map, or a folder of submap_0, submap_1, ...; several "
                   "must continue each other and are one session")
      ->required();
  import->add_option("--keyframes", builder.keyframes, "Keyframes a segment")
      ->check(CLI::Range(2, 2000))
      ->capture_default_str();
  import
      ->add_option(
          "--seconds", builder.seconds, "Close segments by time instead [s]")
      ->check(CLI::PositiveNumber);
  import->add_option(
      "--session", builder.session, "Name of the session [the mission's id]");
  import
      ->add_option("--min-observations",
                   builder.min_observations,
                   "Leave out landmarks that a segment sees less often")
      ->capture_default_str();
  import
      ->add_option("--calibration-version",
                   builder.calibration_version,
                   "The version that the map was estimated with")
      ->capture_default_str();
  import
      ->add_option("--temperature",
                   options->temperature_c,
                   "The device's temperature at the time [degrees Celsius]")
      ->check(CLI::Range(SegmentLimits{}.min_temperature_c,
                         SegmentLimits{}.max_temperature_c));
  import->add_flag("--all-landmarks",
                   options->all_landmarks,
                   "Also those that the map does not call good");
  import
      ->add_option("--timeout",
                   options->timeout_s,
                   "Give up after this long without an answer [s]")
      ->check(CLI::Range(0.001, 1e6))
      ->capture_default_str();
  import->callback([context, options] {
    context->command = [context, options] { return Import(context, *options);
};
}  // namespace selfcal::client
);
}

}  // namespace selfcal::client
