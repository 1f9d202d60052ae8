// verify: checks that both estimation cores agree with what the daemon has
// computed.
#include <fmt/format.h>

#include <memory>
#include <string>

#include "client/cli/commands.h"
#include "client/cli/progress.h"
#include "client/text/text.h"
#include "proto/resource_names.h"
#include "selfcal/v1/calibration_service.grpc.pb.h"

namespace selfcal::client {
namespace {

using VerifyResponse = v1::VerifyRigResponse;

std::string OutcomeText(VerifyResponse::Outcome outcome,
                        const std::string& message) {
  switch (outcome) {
    case VerifyResponse::AGREES:
      return "agrees";
    case VerifyResponse::DIFFERS:
      return "differs";
    default:
      return "not compared: " + message;
  }
}

std::string DifferenceText(const VerifyResponse::ScoreCheck& check) {
  if (check.outcome() == VerifyResponse::NOT_COMPARED) return "";
  return fmt::format(
      "entropy {:.2g} nat, information {:.2g}, estimate {:.2g} sigma",
      check.entropy_difference_nats(),
      check.information_difference(),
      check.estimate_difference_sigmas());
}

std::string DifferenceText(const VerifyResponse::CalibrationCheck& check) {
  if (check.outcome() == VerifyResponse::NOT_COMPARED) return "";
  return fmt::format(
      "{} {:.2g} sigma, sigma of {} {:.2g} %, covariance {:.2g} %",
      check.theta_component(),
      check.theta_difference_sigmas(),
      check.sigma_component(),
      100 * check.sigma_difference(),
      100 * check.covariance_difference());
}

// Prints each check when it is done.
void PrintVerification(const Context& context, const VerifyResponse& response) {
  Table line({{""}, {""}, {""}});
  if (response.has_score()) {
    const auto& check = response.score();
    line.Add({"segment " + LastPart(check.segment()),
              OutcomeText(check.outcome(), check.message()),
              DifferenceText(check)});
  } else {
    const auto& check = response.calibration();
    line.Add({fmt::format("calibration {}", check.version()),
              OutcomeText(check.outcome(), check.message()),
              DifferenceText(check)});
  }
  context.Print(line);
}

void PrintVerification(const Context& context,
                       const VerifyResponse::Summary& summary) {
  Facts facts;
  facts.Add("active version", fmt::format("{}", summary.version()));
  facts.Add("scores",
            fmt::format("{}, {} differ, {} not compared",
                        summary.scores(),
                        summary.scores_differing(),
                        summary.scores_not_compared()));
  facts.Add("largest differences of scores",
            fmt::format(
                "entropy {:.2g} nat, information {:.2g}, estimate {:.2g} sigma",
                summary.entropy_difference_nats(),
                summary.information_difference(),
                summary.estimate_difference_sigmas()));
  if (summary.has_calibration()) {
    const auto& check = summary.calibration();
    facts.Add("calibration", OutcomeText(check.outcome(), check.message()));
    facts.Add("difference", DifferenceText(check));
    facts.Add("segments",
              fmt::format("{}, {} of the version are no longer kept",
                          check.segments(),
                          check.segments_gone()));
  } else {
    facts.Add("calibration", "factory calibration: it was not computed");
  }
  if (!summary.finding().empty()) {
    facts.Add("not trustworthy", summary.finding());
  }
  context.Print(facts);
}

// Returns 1 if the cores disagree or not everything could be compared.
int ExitCode(const VerifyResponse::Summary& summary) {
  if (!summary.finding().empty()) {
    PrintError(fmt::format("version {} is not trustworthy: {}",
                           summary.version(),
                           summary.finding()));
    return kFailed;
  }
  const bool compared =
      summary.scores_not_compared() == 0 &&
      (!summary.has_calibration() ||
       summary.calibration().outcome() != VerifyResponse::NOT_COMPARED);
  if (compared) return kDone;
  PrintError("not everything could be compared; what was compared agrees");
  return kFailed;
}

int Verify(Context* context, const std::string& rig) {
  const auto stub = v1::CalibrationService::NewStub(context->Channel());
  grpc::ClientContext call;
  v1::VerifyRigRequest request;
  request.set_parent(RigName(rig));
  const auto reader = stub->VerifyRig(&call, request);
  VerifyResponse response;
  bool whole = false;
  {
    Progress progress("verification");
    while (reader->Read(&response)) {
      whole = response.has_summary();
      if (response.has_progress()) {
        progress.Show(static_cast<std::size_t>(response.progress().done()),
                      static_cast<std::size_t>(response.progress().total()),
                      response.progress().subject());
      }
      if (context->json) {
        context->PrintJson(response, /*line=*/true);
      } else if (response.has_score() || response.has_calibration()) {
        progress.Clear();
        PrintVerification(*context, response);
      }
    }
  }
  const grpc::Status status = reader->Finish();
  if (!status.ok()) return Fail(*context, status);
  if (!whole) {
    PrintError("the verification ended without a summary: try again");
    return kFailed;
  }
  if (!context->json) PrintVerification(*context, response.summary());
  return ExitCode(response.summary());
}

}  // namespace

CLI::App* AddVerify(CLI::App* parent,
                    const std::string& name,
                    Context* context) {
  CLI::App* verify = parent->add_subcommand(
      name,
      "Compute the scores of all segments whose data is kept, and the active "
      "version, with both estimation cores, and compare them; takes minutes. "
      "Exits with 1 if they differ by more than rounding or convergence "
      "explains, or if something could not be compared");
  const auto rig = std::make_shared<std::string>();
  verify->add_option("RIG", *rig)->required();
  verify->callback([context, rig] {
    context->command = [context, rig] { return Verify(context, *rig); };
  });
  return verify;
}

}  // namespace selfcal::client
