#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <thread>
#include <tuple>
#include <vector>

#include "client/cli/commands.h"
#include "client/cli/motion_advice.h"
#include "client/cli/positive_number.h"
#include "client/text/text.h"
#include "selfcal/v1/calibration_service.pb.h"

namespace selfcal::client {
namespace {

using AdviceResponse = v1::AdviseMotionResponse;

// A segment is scored every few seconds.
constexpr std::chrono::milliseconds kPoll(1000);

// Returns e.g. "imu 3.10, camera 0.42".
std::string GroupsText(const AdviceResponse::Advice& advice) {
  std::vector<std::string> parts;
  for (const auto& gain : advice.group_gains()) {
    parts.push_back(
        fmt::format("{} {}", gain.group(), GainText(gain.gain_nats())));
  }
  return fmt::format("{}", fmt::join(parts, ", "));
}

// Returns the component whose sigma the motion reduces most, e.g.
// "cam0.p_CI.z 0.013 -> 0.0041 m".
std::string SharpestText(const AdviceResponse::Advice& advice) {
  const auto& changes = advice.sigma_changes();
  const auto sharpest = std::min_element(
      changes.begin(), changes.end(), [](const auto& a, const auto& b) {
        return a.sigma_after() * b.sigma_now() <
               b.sigma_after() * a.sigma_now();
      });
  if (sharpest == changes.end()) return "";
  const std::string unit =
      sharpest->unit() == "-" ? "" : " " + sharpest->unit();
  return fmt::format("{} {} -> {}{}",
                     sharpest->component(),
                     SigmaText(sharpest->sigma_now()),
                     SigmaText(sharpest->sigma_after()),
                     unit);
}

std::string KnownText(const AdviceResponse& response) {
  return fmt::format("version {} and {} since",
                     response.calibration_version(),
                     CountText(response.segments_since(), "segment"));
}

Table AdviceTable(const AdviceResponse& response) {
  Table table({{"#", true},
               {"motion"},
               {"gain [nat]", true},
               {"by group"},
               {"largest improvement"},
               {"what to do", false, true}});
  int rank = 0;
  for (const auto& advice : response.advice()) {
    table.Add({fmt::format("{}", ++rank),
               advice.motion(),
               GainText(advice.gain_nats()),
               GroupsText(advice),
               SharpestText(advice),
               advice.instruction()});
  }
  return table;
}

void PrintAdvice(const Context& context, const AdviceResponse& response) {
  if (context.json) {
    context.PrintJson(response);
    return;
  }
  if (context.terminal) {
    PrintText(fmt::format("known: {}; least known, in reference sigmas:\n",
                          KnownText(response)));
    for (const auto& weak : response.weakest()) {
      PrintText(fmt::format(
          "  {:8.3g}  {}\n", weak.sigma_by_reference(), weak.words()));
    }
    PrintText(MissingText(response));
    PrintText(fmt::format("predicted for a segment of {:g} s:\n",
                          response.segment_seconds()));
  }
  context.Print(AdviceTable(response));
}

// Prints one line: the best motion now, and its gain.
void PrintLine(const Context& context, const AdviceResponse& response) {
  if (context.json) {
    context.PrintJson(response, true);
    return;
  }
  if (response.advice().empty()) return;
  const auto& best = response.advice(0);
  PrintText(fmt::format("{}: {} (+{} nat; {})\n",
                        best.motion(),
                        best.instruction(),
                        GainText(best.gain_nats()),
                        KnownText(response)));
}

int Coach(Context* context, const std::string& rig, int top) {
  AdviceResponse response;
  const auto status = AskForAdvice(context, rig, top, &response);
  if (!status.ok()) return Fail(*context, status);
  PrintAdvice(*context, response);
  return kDone;
}

// A new line is printed when the motion changes, or the information that it
// follows from.
using AdviceSubject = std::tuple<std::string, std::int64_t, int>;
AdviceSubject SubjectOf(const AdviceResponse& response) {
  return {response.advice().empty() ? "" : response.advice(0).motion(),
          response.calibration_version(),
          response.segments_since()};
}

// Prints `count` lines or, if `count` is 0, continues until the daemon ends.
int WatchAdvice(Context* context,
                const std::string& rig,
                int top,
                std::int64_t count) {
  AdviceSubject printed;
  for (std::int64_t lines = 0;;) {
    AdviceResponse response;
    const auto status = AskForAdvice(context, rig, top, &response);
    if (!status.ok()) return Fail(*context, status);
    if (SubjectOf(response) != printed) {
      printed = SubjectOf(response);
      PrintLine(*context, response);
      if (++lines == count) return kDone;
    }
    std::this_thread::sleep_for(kPoll);
  }
}

}  // namespace

CLI::App* AddCoach(CLI::App* parent,
                   const std::string& name,
                   Context* context) {
  CLI::App* coach = parent->add_subcommand(
      name, "Recommend the motions with the largest predicted gain");
  const auto rig = std::make_shared<std::string>();
  const auto top = std::make_shared<int>(3);
  const auto watch = std::make_shared<bool>(false);
  const auto count = std::make_shared<std::int64_t>(0);
  coach->add_option("RIG", *rig)->required();
  coach->add_option("--top", *top, "Number of motions to print")
      ->check(AtLeastOne())
      ->capture_default_str();
  CLI::Option* watching = coach->add_flag(
      "--watch", *watch, "Print a line now, and whenever the advice changes");
  coach->add_option("--count", *count, "With --watch: exit after this many")
      ->needs(watching)
      ->check(AtLeastOne());
  coach->callback([context, rig, top, watch, count] {
    context->command = [context, rig, top, watch, count] {
      return *watch ? WatchAdvice(context, *rig, *top, *count)
                    : Coach(context, *rig, *top);
    };
  });
  return coach;
}

}  // namespace selfcal::client
