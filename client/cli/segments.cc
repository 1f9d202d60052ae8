#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include "client/cli/commands.h"
#include "client/cli/group_check.h"
#include "client/cli/instruction.h"
#include "client/cli/list_options.h"
#include "client/text/text.h"
#include "proto/resource_names.h"
#include "selfcal/v1/segment.grpc.pb.h"

namespace selfcal::client {
namespace {

using SegmentService = v1::SegmentService::StubInterface;

std::string DurationText(const v1::Segment& segment) {
  return fmt::format(
      "{:.2f}",
      static_cast<double>(segment.end_ns() - segment.start_ns()) * 1e-9);
}

// The temperature in degrees Celsius.
std::string TemperatureText(const v1::Segment& segment) {
  return segment.has_temperature_c()
             ? fmt::format("{:.1f}", segment.temperature_c())
             : "-";
}

// A quantity of the motion.
std::string MotionText(const v1::Segment& segment, double value) {
  return segment.has_motion() ? fmt::format("{:.2f}", value) : "-";
}

// Returns the groups of the rigs, in the order of the first that has them.
std::vector<std::string> Groups(const v1::ListSegmentsResponse& segments) {
  std::vector<std::string> groups;
  for (const v1::Segment& segment : segments.segments()) {
    for (const auto& score : segment.scores()) {
      if (std::find(groups.begin(), groups.end(), score.group()) ==
          groups.end()) {
        groups.push_back(score.group());
      }
    }
  }
  return groups;
}

std::string EntropyText(const v1::Segment& segment, const std::string& group) {
  for (const v1::GroupScore& score : segment.scores()) {
    if (score.group() == group) {
      return fmt::format("{:.2f}", score.entropy_nats());
    }
  }
  return "-";
}

// The groups whose tables hold the segment.
std::string TablesText(const v1::Segment& segment) {
  std::string text;
  for (const v1::GroupScore& score : segment.scores()) {
    if (!score.in_table()) continue;
    text += (text.empty() ? "" : ",") + score.group();
  }
  return text.empty() ? "-" : text;
}

// A list of the segments of many rigs has the rig before each.
Table UnusableTable(const v1::ListSegmentsResponse& segments, bool of_many) {
  std::vector<Column> columns = {
      {"segment"}, {"received"}, {"problem", false, true}};
  if (of_many) columns.insert(columns.begin(), Column{"rig"});
  Table table(std::move(columns));
  for (const v1::Segment& segment : segments.segments()) {
    std::vector<std::string> row = {LastPart(segment.name()),
                                    TimeText(segment.receive_time()),
                                    segment.problem()};
    if (of_many) row.insert(row.begin(), RigPart(segment.name()));
    table.Add(std::move(row));
  }
  return table;
}

Table ListTable(const v1::ListSegmentsResponse& segments, bool of_many) {
  std::vector<Column> columns = {{"segment"},
                                 {"state"},
                                 {"data", true},
                                 {"keyframes", true},
                                 {"seconds", true},
                                 {"landmarks", true},
                                 {"observations", true}};
  const auto groups = Groups(segments);
  for (const std::string& group : groups) {
    columns.push_back({"H(" + group + ")", true});
  }
  columns.push_back({"in tables"});
  columns.push_back({"T [C]", true});
  columns.push_back({"w [rad/s]", true});
  columns.push_back({"a [m/s^2]", true});
  if (of_many) columns.insert(columns.begin(), Column{"rig"});
  Table table(std::move(columns));
  for (const v1::Segment& segment : segments.segments()) {
    std::vector<std::string> row = {
        LastPart(segment.name()),
        StateText(segment.state()),
        segment.has_data() ? BytesText(segment.payload_bytes()) : "-",
        fmt::format("{}", segment.keyframes()),
        DurationText(segment),
        fmt::format("{}", segment.landmarks()),
        fmt::format("{}", segment.observations())};
    for (const std::string& group : groups) {
      row.push_back(EntropyText(segment, group));
    }
    row.push_back(TablesText(segment));
    row.push_back(TemperatureText(segment));
    row.push_back(MotionText(segment, segment.motion().angular_rate()));
    row.push_back(MotionText(segment, segment.motion().acceleration()));
    if (of_many) row.insert(row.begin(), RigPart(segment.name()));
    table.Add(std::move(row));
  }
  return table;
}

Facts Describe(const v1::Segment& segment) {
  Facts facts;
  facts.Add("segment", LastPart(segment.name()));
  facts.Add("state", StateText(segment.state()));
  if (!segment.problem().empty()) facts.Add("problem", segment.problem());
  facts.Add("received", TimeText(segment.receive_time()));
  facts.Add("data",
            segment.has_data() ? BytesText(segment.payload_bytes()) : "-");
  facts.Add("calibration", fmt::format("{}", segment.calibration_version()));
  facts.Add("seconds", DurationText(segment));
  facts.Add("keyframes", fmt::format("{}", segment.keyframes()));
  if (segment.has_temperature_c()) {
    facts.Add("temperature", TemperatureText(segment) + " C");
  }
  if (segment.has_motion()) {
    const v1::Segment::Motion& motion = segment.motion();
    facts.Add("angular rate",
              MotionText(segment, motion.angular_rate()) + " rad/s");
    facts.Add("acceleration",
              MotionText(segment, motion.acceleration()) + " m/s^2");
  }
  facts.Add("IMU samples", fmt::format("{}", segment.imu_samples()));
  facts.Add("landmarks", fmt::format("{}", segment.landmarks()));
  facts.Add("observations", fmt::format("{}", segment.observations()));
  if (!segment.has_residuals()) return facts;
  const v1::ResidualStatistics& residuals = segment.residuals();
  facts.Add("inliers",
            fmt::format("{}{}",
                        residuals.inliers(),
                        residuals.many_outliers() ? " (many outliers)" : ""));
  facts.Add("reprojection median",
            fmt::format("{:.3f} px", residuals.reprojection_median_px()));
  facts.Add("reprojection rms",
            fmt::format("{:.3f} px", residuals.reprojection_rms_px()));
  if (residuals.fit() > 0) {
    facts.Add("fit", fmt::format("{:.3g}", residuals.fit()));
  }
  if (residuals.imu_gaps() > 0) {
    facts.Add("IMU gaps",
              fmt::format("{}, the longest {:.0f} ms",
                          residuals.imu_gaps(),
                          1e3 * residuals.longest_imu_gap_s()));
  }
  facts.Add("observed directions",
            fmt::format("{} of {}", segment.rank(), segment.components()));
  return facts;
}

Table Scores(const v1::Segment& segment) {
  Table table({{"group"},
               {"H [nat]", true},
               {"gain [nat]", true},
               {"rank", true},
               {"in table"}});
  const auto reason = [&](const std::string& group) {
    for (const v1::TableExclusion& exclusion : segment.exclusions()) {
      if (exclusion.group() == group) return "no: " + exclusion.reason();
    }
    return std::string("no");
  };
  for (const v1::GroupScore& score : segment.scores()) {
    table.Add({score.group(),
               fmt::format("{:.3f}", score.entropy_nats()),
               fmt::format("{:.3f}", score.gain_nats()),
               fmt::format("{}/{}", score.rank(), score.size()),
               score.in_table() ? "yes" : reason(score.group())});
  }
  return table;
}

struct SegmentListOptions {
  std::string rig;
  ListOptions list;
  bool quarantined = false;
};

// Returns the conditions of the list, with that of the flag --quarantined.
std::string FilterOf(const SegmentListOptions& options) {
  constexpr char kUnusable[] = "state = UNUSABLE";
  const std::string& filter = options.list.filter;
  if (!options.quarantined) return filter;
  return filter.empty() ? kUnusable : filter + " AND " + kUnusable;
}

int ListSegments(Context* context, const SegmentListOptions& options) {
  const auto stub = v1::SegmentService::NewStub(context->Channel());
  v1::ListSegmentsRequest request;
  request.set_filter(FilterOf(options));
  request.set_order_by(options.list.order_by);
  if (options.rig.empty()) {
    request.set_rig_filter(options.list.rigs);
  } else {
    request.set_parent(RigName(options.rig));
    const absl::Status known =
        CheckGroups(*context,
                    options.rig,
                    {{"--filter", options.list.filter},
                     {"--order-by", options.list.order_by}});
    if (!known.ok()) return FailInput(known);
  }
  v1::ListSegmentsResponse segments;
  const auto status =
      CallForItems<SegmentService>(stub.get(),
                                   &SegmentService::ListSegments,
                                   request,
                                   &v1::ListSegmentsResponse::mutable_segments,
                                   options.list.limit,
                                   nullptr,
                                   &segments);
  if (!status.ok()) return Fail(*context, status);
  if (context->PrintList(segments)) return kDone;
  const bool of_many = options.rig.empty();
  context->Print(options.quarantined ? UnusableTable(segments, of_many)
                                     : ListTable(segments, of_many));
  return kDone;
}

int ShowSegment(Context* context,
                const std::string& rig,
                const std::string& id) {
  const auto stub = v1::SegmentService::NewStub(context->Channel());
  v1::GetSegmentRequest request;
  request.set_name(RigName(rig) + "/segments/" + LastPart(id));
  v1::Segment segment;
  const auto status = Call<SegmentService>(
      stub.get(), &SegmentService::GetSegment, request, &segment);
  if (!status.ok()) return Fail(*context, status);
  if (context->json) {
    context->PrintJson(segment);
    return kDone;
  }
  context->Print(Describe(segment));
  if (segment.scores().empty()) return kDone;
  if (context->terminal) PrintText("\n");
  context->Print(Scores(segment));
  for (const auto& direction : segment.unobserved()) {
    PrintText(context->terminal ? "not observed: " : "not observed\t");
    PrintText(DirectionText(direction) + "\n");
  }
  return kDone;
}

struct QuarantineOptions {
  std::string rig;
  std::string segments;  // a session, or session~index
  std::string reason;
};

// Returns false if the text names neither a session nor a segment.
bool NameSegments(const QuarantineOptions& options,
                  v1::QuarantineSegmentsRequest* request) {
  request->set_parent(RigName(options.rig));
  const std::string id = LastPart(options.segments);
  const bool one = id.find('~') != id.npos;
  // A session is parsed as a segment of it, because its characters are encoded
  // in the same way.
  const auto parts = ParseSegmentName(RigName(options.rig) + "/segments/" + id +
                                      (one ? "" : "~0"));
  if (!parts) return false;
  request->set_session(parts->key.session);
  if (one) request->set_index(parts->key.index);
  return true;
}

int Quarantine(Context* context, const QuarantineOptions& options) {
  v1::QuarantineSegmentsRequest request;
  if (!NameSegments(options, &request)) {
    return FailInput(absl::InvalidArgumentError(fmt::format(
        "'{}' is neither a session nor a segment; `selfcal segment list {}` "
        "lists segments as session~index",
        options.segments,
        options.rig)));
  }
  request.set_reason(options.reason);
  const auto stub = v1::SegmentService::NewStub(context->Channel());
  v1::QuarantineSegmentsResponse response;
  const auto status = Call<SegmentService>(
      stub.get(), &SegmentService::QuarantineSegments, request, &response);
  v1::Instruction instruction;
  *instruction.mutable_quarantine_segments() = request;
  if (const auto code = EndFailed(status, *context, options.rig, instruction)) {
    return *code;
  }
  if (context->json) {
    context->PrintJson(response);
    return kDone;
  }
  Facts facts;
  facts.Add("quarantined", fmt::format("{}", response.quarantined()));
  facts.Add("unusable before", fmt::format("{}", response.unusable()));
  context->Print(facts);
  return kDone;
}

struct SegmentDeletion {
  std::string rig;
  std::string segment;
  std::string reason;
};

int DeleteSegment(Context* context, const SegmentDeletion& options) {
  const auto stub = v1::SegmentService::NewStub(context->Channel());
  v1::DeleteSegmentRequest request;
  request.set_name(RigName(options.rig) + "/segments/" +
                   LastPart(options.segment));
  request.set_reason(options.reason);
  google::protobuf::Empty response;
  const auto status = Call<SegmentService>(
      stub.get(), &SegmentService::DeleteSegment, request, &response);
  if (!status.ok()) return Fail(*context, status);
  if (!context->json) PrintText(fmt::format("deleted {}\n", request.name()));
  return kDone;
}

void AddDelete(CLI::App* segments, Context* context) {
  const auto options = std::make_shared<SegmentDeletion>();
  CLI::App* remove = segments->add_subcommand(
      "delete",
      "Delete a segment that no calibration was computed from. This cannot be "
      "undone");
  remove->add_option("RIG", options->rig)->required();
  remove
      ->add_option("SEGMENT", options->segment, "session~index, as in the list")
      ->required();
  remove
      ->add_option("--reason",
                   options->reason,
                   "The reason; the event log records it with your name")
      ->required();
  remove->callback([context, options] {
    context->command = [context, options] {
      return DeleteSegment(context, *options);
    };
  });
}

void AddQuarantine(CLI::App* segments, Context* context) {
  const auto options = std::make_shared<QuarantineOptions>();
  CLI::App* quarantine = segments->add_subcommand(
      "quarantine",
      "Quarantine a segment, or all segments of a session: they are never used "
      "again. This cannot be undone");
  quarantine->add_option("RIG", options->rig)->required();
  quarantine
      ->add_option("SEGMENT",
                   options->segments,
                   "session~index, as in the list; or a session")
      ->required();
  quarantine
      ->add_option("--reason",
                   options->reason,
                   "The reason; the event log records it with your name")
      ->required();
  quarantine->callback([context, options] {
    context->command = [context, options] {
      return Quarantine(context, *options);
    };
  });
}

}  // namespace

void AddSegmentCommands(CLI::App* app, Context* context) {
  CLI::App* segments =
      app->add_subcommand("segment", "Send, check, show and export segments")
          ->alias("segments");
  segments->require_subcommand(1);

  const auto options = std::make_shared<SegmentListOptions>();
  CLI::App* list = segments->add_subcommand(
      "list",
      "List the segments of a rig, or of all, newest first, with the entropy "
      "of each group [nat] (lower is more informative) and the tables that "
      "hold "
      "it");
  CLI::Option* const of = list->add_option("RIG", options->rig);
  AddListOptions(list,
                 context,
                 "the first of the list",
                 kSegmentFilterHelp,
                 &options->list);
  AddRigFilter(list, of, &options->list);
  AddOrderBy(list,
             ", e.g. 'entropy.camera asc'; without RIG: receive_time, "
             "temperature_c, angular_rate, acceleration or gain.GROUP",
             &options->list);
  list->add_flag("--quarantined",
                 options->quarantined,
                 "List only unusable and quarantined segments, with the "
                 "reasons");
  list->callback([context, options] {
    context->command = [context, options] {
      return ListSegments(context, *options);
    };
  });

  const auto rig = std::make_shared<std::string>();
  const auto id = std::make_shared<std::string>();
  CLI::App* show = segments->add_subcommand("show", "Show a segment");
  show->add_option("RIG", *rig)->required();
  show->add_option("SEGMENT", *id, "session~index, as in the list")->required();
  show->callback([context, rig, id] {
    context->command = [context, rig, id] {
      return ShowSegment(context, *rig, *id);
    };
  });

  AddImport(segments, "import", context);
  AddPreflight(segments, "preflight", context);
  AddSegmentDetails(segments, context);
  AddDelete(segments, context);
  AddQuarantine(segments, context);
  AddSegmentExport(segments, context);
}

}  // namespace selfcal::client
