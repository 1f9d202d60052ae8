// cohort apply: gives the prior of a cohort to existing rigs. A rig that has it
// already is left as it is, so that the command can be repeated where it failed
// for some rigs.
#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "client/cli/bulk.h"
#include "client/cli/cohort_versions.h"
#include "client/cli/commands.h"
#include "client/text/text.h"
#include "core/model/rig.h"
#include "proto/convert.h"
#include "proto/resource_names.h"
#include "selfcal/v1/rig.grpc.pb.h"

namespace selfcal::client {
namespace {

using RigService = v1::RigService::StubInterface;

struct ApplyOptions {
  std::string cohort;  // LABEL=VALUE
  std::int64_t version = 0;
  BulkOptions bulk;
  std::string reason;
  bool outliers = false;
};

struct PriorChange {
  v1::UpdateRigRequest request;
  v1::Rig after;               // the rig, with its new prior
  std::string largest_change;  // of the mean
};

// The prior of a version of a cohort.
struct CohortPrior {
  v1::CohortVersion version;
  Rig rig;  // of a new device: its factory calibration is the mean
  std::set<std::string> determined;  // components, by the devices
};

std::optional<CohortPrior> ParsePrior(const v1::CohortVersion& version) {
  CohortPrior prior{version, {}, {}};
  v1::Rig message = version.cohort().prior();
  message.set_name(RigName("prior"));
  if (!FromProto(message, "", &prior.rig).empty()) return std::nullopt;
  for (const v1::CohortComponent& component : version.cohort().components()) {
    if (component.spread_degrees() > 0) {
      prior.determined.insert(component.component());
    }
  }
  return prior;
}

// Why a rig cannot have the prior; empty if it can.
std::string WhyNotApplied(const CohortPrior& prior,
                          bool outliers,
                          const v1::Rig& message,
                          const Rig& rig) {
  const v1::CohortVersion& version = prior.version;
  const auto label = message.labels().find(version.label());
  if (label == message.labels().end() || label->second != version.value()) {
    return fmt::format(
        "it is not of the cohort {}={}", version.label(), version.value());
  }
  if (!SameShape(rig.factory, prior.rig.factory) ||
      !SameImages(rig.factory, prior.rig.factory)) {
    return "its cameras, IMUs or optional blocks differ from those of the "
           "cohort";
  }
  if (FreeComponents(rig) != FreeComponents(prior.rig)) {
    return "it estimates other components than the rigs of the cohort (blocks, "
           "fixed)";
  }
  const auto& listed = version.cohort().outliers();
  const bool is_outlier =
      std::any_of(listed.begin(), listed.end(), [&](const auto& outlier) {
        return outlier.rig() == message.name();
      });
  if (is_outlier && !outliers) {
    return "it contradicts its cohort ('selfcal cohort show'); --outliers "
           "includes it";
  }
  return "";
}

// The rig with mean and sigmas of the cohort in the components that it
// estimates and that the devices of the cohort determine. In the others, the
// prior of the cohort is that of one rig among them.
Rig WithPrior(const Rig& rig, const CohortPrior& prior) {
  Rig after = rig;
  const auto components = TangentComponents(rig.factory);
  const Eigen::VectorXd sigmas = PriorSigmas(prior.rig);
  const Eigen::VectorXd of_cohort = BoxMinus(prior.rig.factory, rig.factory);
  Eigen::VectorXd mean = BoxMinus(PriorMean(rig), rig.factory);
  for (const int k : FreeComponents(rig)) {
    const std::string& name = components[static_cast<std::size_t>(k)].name;
    if (!prior.determined.contains(name)) continue;
    mean(k) = of_cohort(k);
    std::erase_if(after.prior_sigmas, [&](const ComponentSetting& setting) {
      return setting.pattern == name;
    });
    after.prior_sigmas.push_back({name, sigmas(k)});
  }
  after.prior_mean = BoxPlus(rig.factory, mean);
  return after;
}

// Distance by which the mean of each component moves, in sigmas of the new
// prior.
Eigen::VectorXd ChangeOfMean(const Rig& before, const Rig& after) {
  return BoxMinus(PriorMean(after), PriorMean(before))
      .cwiseAbs()
      .cwiseQuotient(PriorSigmas(after));
}

bool IsSamePrior(const Rig& before, const Rig& after) {
  constexpr double kRounding = 1e-6;  // in sigmas
  return PriorSigmas(before) == PriorSigmas(after) &&
         ChangeOfMean(before, after).maxCoeff() < kRounding;
}

// "cam0.focal.x by 1.3 sigma".
std::string LargestChange(const Rig& before, const Rig& after) {
  Eigen::Index largest = 0;
  const double by = ChangeOfMean(before, after).maxCoeff(&largest);
  const auto components = TangentComponents(after.factory);
  return fmt::format("{} by {:.1f} sigma",
                     components[static_cast<std::size_t>(largest)].name,
                     by);
}

// Appends the change of a rig, unless it has this prior, or says why it is left
// out.
void AddPriorChange(const CohortPrior& prior,
                    const ApplyOptions& options,
                    const v1::Rig& message,
                    std::vector<PriorChange>* plans) {
  Rig rig;
  const std::string why =
      FromProto(message, "", &rig).empty()
          ? WhyNotApplied(prior, options.outliers, message, rig)
          : "it cannot be read";
  if (!why.empty()) {
    PrintError(
        fmt::format("{} is left out: {}", LastPart(message.name()), why));
    return;
  }
  const Rig after = WithPrior(rig, prior);
  if (IsSamePrior(rig, after)) return;
  PriorChange& plan = plans->emplace_back();
  plan.largest_change = LargestChange(rig, after);
  const v1::Rig changed = ToProto(after);
  v1::Rig* const update = plan.request.mutable_rig();
  update->set_name(message.name());
  *update->mutable_prior_mean() = changed.prior_mean();
  *update->mutable_prior_sigmas() = changed.prior_sigmas();
  plan.request.mutable_update_mask()->add_paths("prior_mean");
  plan.request.mutable_update_mask()->add_paths("prior_sigmas");
  plan.request.set_reason(options.reason);
  plan.after = message;
  *plan.after.mutable_prior_mean() = changed.prior_mean();
  *plan.after.mutable_prior_sigmas() = changed.prior_sigmas();
}

// Prints the rigs alone with --json, one by one.
void PrintPlans(const Context& context,
                std::int64_t version,
                const std::vector<PriorChange>& plans) {
  if (context.json) {
    for (const PriorChange& plan : plans) context.PrintJson(plan.after);
    return;
  }
  Table table({{"rig"},
               {"version of the cohort", true},
               {"largest change of the mean"}});
  for (const PriorChange& plan : plans) {
    table.Add({LastPart(plan.after.name()),
               std::to_string(version),
               plan.largest_change});
  }
  context.Print(table);
}

std::vector<BulkChange> ChangesOf(RigService* stub,
                                  const std::vector<PriorChange>& plans) {
  std::vector<BulkChange> changes;
  for (const PriorChange& plan : plans) {
    changes.push_back(UpdateOf(stub, plan.request));
  }
  return changes;
}

int Apply(Context* context, const ApplyOptions& options) {
  absl::StatusOr<v1::CohortVersion> version;
  grpc::Status status =
      ReadCohortPrior(*context, options.cohort, options.version, &version);
  if (!status.ok()) return Fail(*context, status);
  if (!version.ok()) return FailInput(version.status());
  const std::optional<CohortPrior> prior = ParsePrior(*version);
  if (!prior) {
    return FailInput(
        absl::InvalidArgumentError("the prior of the cohort cannot be read"));
  }
  std::vector<v1::Rig> rigs;
  status = ReadRigs(*context, options.bulk.filter, &rigs);
  if (!status.ok()) return Fail(*context, status);
  std::vector<PriorChange> plans;
  for (const v1::Rig& rig : rigs) {
    AddPriorChange(*prior, options, rig, &plans);
  }
  PrintPlans(*context, version->version(), plans);
  const auto stub = v1::RigService::NewStub(context->Channel());
  return CarryOut(*context,
                  options.bulk,
                  {"Change the prior of", "changed"},
                  ChangesOf(stub.get(), plans));
}

}  // namespace

void AddCohortApply(CLI::App* cohorts, Context* context) {
  const auto options = std::make_shared<ApplyOptions>();
  CLI::App* apply = cohorts->add_subcommand(
      "apply",
      "Give the prior of a cohort, the mean and the spread of its devices, to "
      "existing rigs of the cohort; it takes effect with their next runs");
  apply->add_option("COHORT", options->cohort, "LABEL=VALUE, e.g. model=t4")
      ->required();
  AddBulkOptions(apply, &options->bulk)->required();
  apply
      ->add_option("--reason",
                   options->reason,
                   "The reason; the event logs record it with your name")
      ->required();
  apply
      ->add_option("--version",
                   options->version,
                   "Version of the statistics, as in the list [newest]")
      ->check(CLI::Range(std::int64_t{1}, INT64_MAX));
  apply->add_flag("--outliers",
                  options->outliers,
                  "Also the rigs that contradict the cohort");
  apply->callback([context, options] {
    context->command = [context, options] { return Apply(context, *options); };
  });
}

}  // namespace selfcal::client
