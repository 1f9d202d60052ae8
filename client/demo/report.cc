#include "client/demo/report.h"

#include <fmt/format.h>
#include <google/protobuf/util/json_util.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <numbers>
#include <utility>

#include "client/text/estimate_text.h"
#include "client/text/text.h"
#include "proto/convert.h"

namespace selfcal::client {
namespace {

nlohmann::json ToJson(const google::protobuf::Message& message) {
  google::protobuf::util::JsonPrintOptions options;
  options.preserve_proto_field_names = true;
  options.always_print_primitive_fields = true;
  std::string text;
  const auto status =
      google::protobuf::util::MessageToJsonString(message, &text, options);
  return status.ok() ? nlohmann::json::parse(text) : nlohmann::json();
}

std::string LastPart(const std::string& name) {
  return name.substr(name.rfind('/') + 1);
}

// Shortens long session names to their end: "...e08f~3".
std::string Short(const std::string& segment_name) {
  const std::string id = LastPart(segment_name);
  return id.size() <= 16 ? id : "..." + id.substr(id.size() - 13);
}

// The components with the largest sigma relative to the factory's, e.g.
// "cam0.p_CI.y 0.33" for a third of it.
std::string LeastKnown(const v1::Calibration& factory,
                       const v1::Calibration& estimate) {
  std::vector<std::pair<double, std::string>> ratios;
  for (int i = 0; i < estimate.estimates_size(); ++i) {
    const double prior = factory.estimates(i).sigma();
    if (prior > 0) {
      ratios.emplace_back(estimate.estimates(i).sigma() / prior,
                          estimate.estimates(i).component());
    }
  }
  std::sort(ratios.rbegin(), ratios.rend());
  std::string words;
  for (std::size_t i = 0; i < std::min<std::size_t>(3, ratios.size()); ++i) {
    words += fmt::format(
        "{}{} {:.2g}", i == 0 ? "" : ", ", ratios[i].second, ratios[i].first);
  }
  return words;
}

std::string DirectionInWords(const v1::UnobservedDirection& direction) {
  std::string words;
  for (const auto& part : direction.parts()) {
    words += fmt::format("{}{:+.2f} {}",
                         words.empty() ? "" : " ",
                         part.weight(),
                         part.component());
  }
  return words;
}

}  // namespace

std::string Fill(const std::vector<v1::Table>& tables) {
  std::string text;
  for (const v1::Table& table : tables) {
    text += fmt::format("{}{} {}/{}",
                        text.empty() ? "" : "  ",
                        LastPart(table.name()),
                        table.entries_size(),
                        table.capacity());
  }
  return text;
}

Report::Report() : terminal_(isatty(STDOUT_FILENO) != 0) {}

void Report::EndProgress() {
  if (progress_open_) fmt::print("\n");
  progress_open_ = false;
}

void Report::Step(const std::string& name, const std::string& text) {
  EndProgress();
  fmt::print("\n{}. {:<11}{}\n", ++step_, name, text);
  std::fflush(stdout);
  json_["steps"].push_back({{"name", name}, {"text", text}});
}

void Report::Line(const std::string& text) {
  EndProgress();
  fmt::print("   {}\n", text);
  std::fflush(stdout);
  json_["steps"].back()["lines"].push_back(text);
}

void Report::Progress(const std::string& text, bool milestone) {
  if (terminal_) {
    fmt::print("\r   {}\x1b[K", text);
    progress_open_ = true;
  } else if (milestone) {
    fmt::print("   {}\n", text);
  }
  std::fflush(stdout);
}

void Report::Fail(const std::string& what) {
  failed_ = true;
  Line("FAILED: " + what);
  json_["failures"].push_back(what);
}

void Report::Segments(const std::vector<v1::Segment>& segments) {
  EndProgress();
  if (segments.empty()) return;
  std::string header =
      fmt::format("{:<18}{:>10}{:>8}", "segment", "seconds", "rms px");
  for (const auto& score : segments.front().scores()) {
    header += fmt::format("{:>22}", score.group() + " H, gain");
  }
  Line(header + "   (nat; + in the table)");
  for (const v1::Segment& segment : segments) {
    std::string line =
        fmt::format("{:<18}{:>10.1f}{:>8.2f}",
                    Short(segment.name()),
                    1e-9 * (segment.end_ns() - segment.start_ns()),
                    segment.residuals().reprojection_rms_px());
    for (const auto& score : segment.scores()) {
      line += fmt::format("{:>12.2f}{:>8.2f} {}",
                          score.entropy_nats(),
                          score.gain_nats(),
                          score.in_table() ? '+' : ' ');
    }
    if (segment.residuals().many_outliers()) line += "  many outliers";
    Line(line);
    json_["segments"].push_back(ToJson(segment));
  }
}

void Report::Tables(const std::vector<v1::Table>& tables) {
  for (const v1::Table& table : tables) {
    std::string line = fmt::format("table {:<12}{}/{}:",
                                   LastPart(table.name()),
                                   table.entries_size(),
                                   table.capacity());
    for (const auto& entry : table.entries()) {
      line += " " + Short(entry.segment());
    }
    if (table.starved()) line += "  starved";
    Line(line);
    json_["tables"].push_back(ToJson(table));
  }
}

void Report::Run(const v1::Recalibration& run) {
  const v1::SolverReport& s = run.solver();
  Line(fmt::format("{} on {}: {}{}",
                   LastPart(run.name()),
                   CountText(run.segments_size(), "segment"),
                   v1::Recalibration::State_Name(run.state()),
                   run.message().empty() ? "" : ", " + run.message()));
  json_["recalibrations"].push_back(ToJson(run));
  if (run.state() != v1::Recalibration::SUCCEEDED) return;
  Line(fmt::format("{} after {} in {:.1f} s; {}, {}, {}, {} ({} left out)",
                   s.status(),
                   CountText(s.iterations(), "iteration"),
                   s.seconds(),
                   CountText(s.partitions(), "partition"),
                   CountText(s.keyframes(), "keyframe"),
                   CountText(s.landmarks(), "landmark"),
                   CountText(s.observations(), "observation"),
                   s.observations_dropped()));
  Line(fmt::format(
      "reprojection rms {:.3f} -> {:.3f} px, median {:.3f} -> {:.3f} px; "
      "{} of {} directions observed",
      s.reprojection_rms_before_px(),
      s.reprojection_rms_after_px(),
      s.reprojection_median_before_px(),
      s.reprojection_median_after_px(),
      s.rank(),
      s.components()));
  for (const auto& direction : s.held_constant()) {
    Line("held constant, not observed: " + DirectionInWords(direction));
  }
}

void Report::Result(const v1::Calibration& factory,
                    const v1::Calibration& estimate,
                    const std::optional<Calibration>& truth) {
  EndProgress();
  // Differences are taken in the tangent space, because a rotation near pi has
  // two rotation vectors.
  Calibration before_theta, after_theta;
  if (!FromProto(factory.parameters(), "", &before_theta).empty() ||
      !FromProto(estimate.parameters(), "", &after_theta).empty()) {
    return Fail("the daemon's calibration cannot be read");
  }
  const Eigen::VectorXd difference =
      BoxMinus(after_theta, truth ? *truth : before_theta);
  Eigen::VectorXd truth_values;
  if (truth) truth_values = ReadableValues(*truth);
  Line("rotations: degrees from the factory's");
  Line(fmt::format("{:<26}{:>5}{:>12}{:>12}{:>12}{:>11}{:>9}",
                   "parameter",
                   "unit",
                   truth ? "truth" : "",
                   truth ? "factory" : "before",
                   truth ? "estimate" : "after",
                   "sigma",
                   truth ? "error/s" : "change/s"));
  int within_3 = 0, estimated = 0;
  double largest = 0;
  for (int i = 0; i < estimate.estimates_size(); ++i) {
    const v1::ComponentEstimate& after = estimate.estimates(i);
    if (after.sigma() == 0) continue;  // held fixed by the rig
    ++estimated;
    const double before = factory.estimates(i).value();
    const double sigmas = difference[i] / after.sigma();
    within_3 += std::abs(sigmas) <= 3;
    largest = std::max(largest, std::abs(sigmas));
    // Rotations are shown in degrees from the factory value.
    const bool turned = after.unit() == "rad";
    const double unit = turned ? 180 / std::numbers::pi : 1;
    const double off = turned ? 0 : before;
    const auto shown = [&](const Eigen::VectorXd& from_factory) {
      return fmt::format("{:.5f}", off + unit * from_factory[i]);
    };
    Line(fmt::format("{:<26}{:>5}{:>12}{:>12.5f}{:>12}{:>11.2g}{:>9.2f}",
                     after.component(),
                     turned ? "deg" : after.unit(),
                     truth ? shown(BoxMinus(*truth, before_theta)) : "",
                     off,
                     shown(BoxMinus(after_theta, before_theta)),
                     unit * after.sigma(),
                     sigmas));
    nlohmann::json row = {{"parameter", after.component()},
                          {"unit", after.unit()},
                          {"factory", before},
                          {"estimate", after.value()},
                          {"sigma", after.sigma()},
                          {truth ? "error_sigmas" : "change_sigmas", sigmas}};
    if (truth) row["truth"] = truth_values[i];
    json_["parameters"].push_back(row);
  }
  json_["calibration"] = ToJson(estimate);
  Line("verdict: " + VerdictText(estimate));
  json_["least_known"] = LeastKnown(factory, estimate);
  Line("least known, as sigma over the factory's: " +
       LeastKnown(factory, estimate));
  if (!truth) return;
  Line(
      fmt::format("{} of {} parameters within 3 sigma of truth, the largest "
                  "error {:.2f} sigma",
                  within_3,
                  estimated,
                  largest));
  if (within_3 < 0.95 * estimated || largest > 4.5) {
    Fail("the estimate does not agree with truth within its own sigma");
  }
}

absl::Status Report::WriteJson(const std::string& path) const {
  nlohmann::json json = json_;
  json["ok"] = !failed_;
  std::ofstream file(path);
  file << json.dump(2) << "\n";
  file.flush();
  if (!file) {
    return absl::UnavailableError(fmt::format("{}: cannot be written", path));
  }
  return absl::OkStatus();
}

}  // namespace selfcal::client
