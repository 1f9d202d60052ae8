// segment export: writes the data of segments to files for other tools.
#include <fmt/format.h>

#include <array>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "client/cli/choice.h"
#include "client/cli/commands.h"
#include "client/cli/group_check.h"
#include "client/cli/new_file.h"
#include "client/cli/progress.h"
#include "client/cli/segment_csv.h"
#include "client/text/text.h"
#include "proto/resource_names.h"
#include "selfcal/v1/segment.grpc.pb.h"

namespace selfcal::client {
namespace {

using SegmentService = v1::SegmentService::StubInterface;

struct ExportOptions {
  std::string rig;
  std::vector<std::string> segments;  // empty: all segments with data
  std::string filter;
  std::string format = "csv";
  std::string output;
  bool force = false;
};

// The destination of the segments, which are written one after the other.
class Sink {
 public:
  virtual ~Sink() = default;
  virtual absl::Status Add(const v1::MotionSegment& segment) = 0;
  virtual absl::Status Finish() = 0;
};

class JsonLines final : public Sink {
 public:
  absl::Status Open(const ExportOptions& options) {
    return file_.Open(options.output, options.force);
  }
  absl::Status Add(const v1::MotionSegment& segment) override {
    return file_.Append(ToJson(segment, true));
  }
  absl::Status Finish() override { return file_.Commit(); }

 private:
  NewFile file_;
};

class CsvFolder final : public Sink {
 public:
  absl::Status Open(const ExportOptions& options) {
    std::error_code error;
    std::filesystem::create_directories(options.output, error);
    for (std::size_t k = 0; k < files_.size(); ++k) {
      const CsvFile& file = SegmentCsvFiles()[k];
      absl::Status opened =
          files_[k].Open(options.output + "/" + file.name, options.force);
      if (opened.ok()) opened = files_[k].Append(file.header);
      if (!opened.ok()) return opened;
    }
    return absl::OkStatus();
  }
  absl::Status Add(const v1::MotionSegment& segment) override {
    const auto rows = SegmentCsvRows(segment);
    for (std::size_t k = 0; k < files_.size(); ++k) {
      if (absl::Status added = files_[k].Append(rows[k]); !added.ok()) {
        return added;
      }
    }
    return absl::OkStatus();
  }
  absl::Status Finish() override {
    for (NewFile& file : files_) {
      if (absl::Status done = file.Commit(); !done.ok()) return done;
    }
    return absl::OkStatus();
  }

 private:
  std::array<NewFile, 4> files_;
};

template <typename T>
absl::StatusOr<std::unique_ptr<Sink>> OpenSink(const ExportOptions& options) {
  auto sink = std::make_unique<T>();
  if (absl::Status opened = sink->Open(options); !opened.ok()) return opened;
  return sink;
}

using OnSegment = std::function<absl::Status(const std::string& name,
                                             const v1::MotionSegment& segment)>;

// Reads each named segment.
grpc::Status ReadNamed(SegmentService* stub,
                       const ExportOptions& options,
                       const OnSegment& on_segment,
                       absl::Status* written) {
  for (const std::string& id : options.segments) {
    v1::GetSegmentDataRequest request;
    request.set_name(RigName(options.rig) + "/segments/" + LastPart(id));
    v1::MotionSegment segment;
    const auto status = Call<SegmentService>(
        stub, &SegmentService::GetSegmentData, request, &segment);
    if (!status.ok()) return status;
    *written = on_segment(request.name(), segment);
    if (!written->ok()) break;
  }
  return grpc::Status::OK;
}

// Reads all segments that meet the filter and have data.
grpc::Status ReadAll(SegmentService* stub,
                     const ExportOptions& options,
                     const OnSegment& on_segment,
                     absl::Status* written) {
  v1::DownloadSegmentsRequest request;
  request.set_parent(RigName(options.rig));
  request.set_filter(options.filter);
  grpc::ClientContext call;
  const auto reader = stub->DownloadSegments(&call, request);
  v1::DownloadSegmentsResponse response;
  while (written->ok() && reader->Read(&response)) {
    *written = on_segment(response.name(), response.segment());
  }
  if (!written->ok()) call.TryCancel();
  const grpc::Status status = reader->Finish();
  return written->ok() ? status : grpc::Status::OK;
}

int ExportSegments(Context* context, const ExportOptions& options) {
  const auto stub = v1::SegmentService::NewStub(context->Channel());
  const absl::Status known =
      CheckGroups(*context, options.rig, {{"--filter", options.filter}});
  if (!known.ok()) return FailInput(known);
  auto sink = options.format == "csv" ? OpenSink<CsvFolder>(options)
                                      : OpenSink<JsonLines>(options);
  if (!sink.ok()) return FailInput(sink.status());
  Progress progress("export");
  std::int64_t segments = 0;
  const auto add = [&](const std::string& name,
                       const v1::MotionSegment& segment) {
    progress.Say(CountText(++segments, "segment") + ", " + LastPart(name));
    return (*sink)->Add(segment);
  };
  absl::Status written;
  const grpc::Status status =
      options.segments.empty() ? ReadAll(stub.get(), options, add, &written)
                               : ReadNamed(stub.get(), options, add, &written);
  progress.Clear();
  if (!status.ok()) return Fail(*context, status);
  if (!written.ok()) return FailInput(written);
  const absl::Status finished = (*sink)->Finish();
  if (!finished.ok()) return FailInput(finished);
  Facts facts;
  facts.Add("segments", fmt::format("{}", segments));
  facts.Add("written", options.output);
  if (!context->json) context->Print(facts);
  return kDone;
}

}  // namespace

void AddSegmentExport(CLI::App* segments, Context* context) {
  CLI::App* command = segments->add_subcommand(
      "export",
      "Write the data of segments to files; they appear when all are complete");
  const auto options = std::make_shared<ExportOptions>();
  command->add_option("RIG", options->rig)->required();
  command->add_option("SEGMENT",
                      options->segments,
                      "session~index, as in the list [all with data]");
  command->add_option("--filter", options->filter, kSegmentFilterHelp);
  command
      ->add_option("--format",
                   options->format,
                   "csv: four tables in a folder; jsonl: one message per line")
      ->check(OneOf({"csv", "jsonl"}))
      ->capture_default_str();
  command->add_option("--output", options->output, "A folder or a file")
      ->required();
  command->add_flag("--force", options->force, "Overwrite existing files");
  command->callback([context, options] {
    context->command = [context, options] {
      return ExportSegments(context, *options);
    };
  });
}

}  // namespace selfcal::client
