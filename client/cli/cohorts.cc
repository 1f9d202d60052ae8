// cohort: what the devices of one model have in common.
#include <fmt/format.h>

#include <cstdint>
#include <memory>
#include <string>

#include "client/cli/cohort_versions.h"
#include "client/cli/commands.h"
#include "client/cli/list_options.h"
#include "client/text/estimate_text.h"
#include "client/text/text.h"
#include "proto/resource_names.h"
#include "selfcal/v1/fleet.grpc.pb.h"

namespace selfcal::client {
namespace {

using FleetService = v1::FleetService::StubInterface;

void PrintComponents(const Context& context, const v1::Cohort& cohort) {
  Table table({{"component"},
               {"unit"},
               {"mean", true},
               {"sigma", true},
               {"spread", true},
               {"tolerance", true},
               {"5 %", true},
               {"50 %", true},
               {"95 %", true}});
  for (const v1::CohortComponent& component : cohort.components()) {
    const auto shown = [&](double value) {
      return ShownValue(value, component.unit());
    };
    const double spread = shown(component.spread());
    const auto quantile = [&](int k) {
      return k < component.quantile_offsets_size()
                 ? ValueText(shown(component.quantile_offsets(k)), spread)
                 : "";
    };
    const double sigma = shown(component.mean_offset_sigma());
    const bool is_known = cohort.estimated() && component.spread_degrees() > 0;
    table.Add({component.component(),
               ShownUnit(component.unit()),
               is_known ? ValueText(shown(component.mean_offset()), sigma) : "",
               is_known ? SigmaText(sigma) : "",
               is_known ? SigmaText(spread) : "",
               SigmaText(shown(component.tolerance())),
               quantile(0),
               quantile(2),
               quantile(4)});
  }
  context.Print(table);
}

void PrintOutliers(const Context& context, const v1::Cohort& cohort) {
  Table table({{"rig"},
               {"version", true},
               {"probability", true},
               {"differs in", false, true}});
  for (const v1::CohortOutlier& outlier : cohort.outliers()) {
    std::string differences;
    for (const auto& component : outlier.components()) {
      const double sigma = ShownValue(component.sigma(), component.unit());
      differences += fmt::format(
          "{}{} by {} +- {} {}",
          differences.empty() ? "" : ", ",
          component.component(),
          ValueText(ShownValue(component.difference(), component.unit()),
                    sigma),
          SigmaText(sigma),
          ShownUnit(component.unit()));
    }
    table.Add({LastPart(outlier.rig()),
               std::to_string(outlier.version()),
               fmt::format("{:.2g}", outlier.probability()),
               differences});
  }
  context.Print(table);
}

int ShowCohort(Context* context, const v1::DescribeCohortRequest& request) {
  const auto stub = v1::FleetService::NewStub(context->Channel());
  v1::Cohort cohort;
  const auto status = Call<FleetService>(
      stub.get(), &FleetService::DescribeCohort, request, &cohort);
  if (!status.ok()) return Fail(*context, status);
  if (context->PrintList(cohort)) return kDone;
  Facts facts;
  facts.Add("rigs",
            fmt::format("{} looked at{}, {} calibrated",
                        cohort.rigs(),
                        cohort.truncated() ? " (there are more)" : "",
                        cohort.calibrated()));
  facts.Add("offsets",
            "from the prior mean of " + LastPart(cohort.reference()));
  if (!cohort.estimated()) {
    facts.Add("mean and spread", "too few devices are calibrated");
  }
  context->Print(facts);
  PrintComponents(*context, cohort);
  if (cohort.outliers_size() > 0) PrintOutliers(*context, cohort);
  if (cohort.skipped_size() > 0) {
    Table table({{"skipped"}, {"because", false, true}});
    for (const v1::SkippedRig& rig : cohort.skipped()) {
      table.Add({LastPart(rig.rig()), rig.reason()});
    }
    context->Print(table);
  }
  return kDone;
}

struct VersionOptions {
  std::string cohort;  // LABEL=VALUE
  std::int64_t version = 0;
  std::string rig;
  ListOptions list;
};

int ListCohorts(Context* context, const VersionOptions& options) {
  v1::ListCohortsRequest request;
  if (!options.cohort.empty()) {
    const absl::Status named = NameCohort(options.cohort, &request);
    if (!named.ok()) return FailInput(named);
  }
  v1::ListCohortsResponse cohorts;
  const auto status =
      CallForCohorts(*context, request, options.list.limit, nullptr, &cohorts);
  if (!status.ok()) return Fail(*context, status);
  if (context->PrintList(cohorts)) return kDone;
  Table table({{"cohort"},
               {"version", true},
               {"computed"},
               {"rigs", true},
               {"calibrated", true},
               {"outliers", true},
               {"prior"}});
  for (const v1::CohortVersion& version : cohorts.cohorts()) {
    const v1::Cohort& cohort = version.cohort();
    table.Add({version.label() + "=" + version.value(),
               fmt::format("{}", version.version()),
               TimeText(version.create_time()),
               fmt::format("{}", cohort.rigs()),
               fmt::format("{}", cohort.calibrated()),
               fmt::format("{}", cohort.outliers_size()),
               cohort.has_prior() ? "yes" : "no"});
  }
  context->Print(table);
  return kDone;
}

int PrintPrior(Context* context, const VersionOptions& options) {
  absl::StatusOr<v1::CohortVersion> found;
  const grpc::Status status =
      ReadCohortPrior(*context, options.cohort, options.version, &found);
  if (!status.ok()) return Fail(*context, status);
  if (!found.ok()) return FailInput(found.status());
  v1::Rig rig = found->cohort().prior();
  rig.set_name(RigName(options.rig));
  (*rig.mutable_labels())[found->label()] = found->value();
  context->PrintJson(rig);
  return kDone;
}

void AddVersionCommands(CLI::App* cohorts, Context* context) {
  const auto options = std::make_shared<VersionOptions>();
  CLI::App* list = cohorts->add_subcommand(
      "list",
      "List the newest statistics of each cohort that a hub describes "
      "(cohort-label), or every version of those of one");
  list->add_option("COHORT", options->cohort, "LABEL=VALUE, e.g. model=t4");
  list->add_option("--limit",
                   options->list.limit,
                   "Only this many, the first of the list [all]");
  AddCsv(list, context);
  list->callback([context, options] {
    context->command = [context, options] {
      return ListCohorts(context, *options);
    };
  });

  CLI::App* prior = cohorts->add_subcommand(
      "prior",
      "Print the rig of a new device of a cohort, for 'rig create': with the "
      "mean of the devices as its factory calibration, and their spread as "
      "its prior sigmas");
  prior->add_option("COHORT", options->cohort, "LABEL=VALUE, e.g. model=t4")
      ->required();
  prior->add_option("RIG", options->rig, "Name of the new rig")->required();
  prior
      ->add_option("--version",
                   options->version,
                   "Version of the statistics, as in the list [newest]")
      ->check(CLI::Range(std::int64_t{1}, INT64_MAX));
  prior->callback([context, options] {
    context->command = [context, options] {
      return PrintPrior(context, *options);
    };
  });
}

}  // namespace

void AddCohortCommands(CLI::App* app, Context* context) {
  CLI::App* cohorts =
      app->add_subcommand("cohort", "Compare the devices of one model")
          ->alias("cohorts");
  cohorts->require_subcommand(1);
  CLI::App* show = cohorts->add_subcommand(
      "show",
      "Show what the calibrations of many rigs have in common, how much they "
      "differ, and which contradict the others");
  const auto request = std::make_shared<v1::DescribeCohortRequest>();
  show->add_option_function<std::string>(
      "--filter",
      [request](const std::string& filter) { request->set_filter(filter); },
      "Only rigs that match, e.g. 'labels.model = \"t4\"'; all by default");
  show->add_option_function<int>(
          "--max-rigs",
          [request](int rigs) { request->set_max_rigs(rigs); },
          "Maximum number of rigs, most recently seen first; 500 by default")
      ->check(CLI::Range(1, 2000));
  AddCsv(show, context);
  show->callback([context, request] {
    context->command = [context, request] {
      return ShowCohort(context, *request);
    };
  });
  AddVersionCommands(cohorts, context);
  AddCohortApply(cohorts, context);
}

}  // namespace selfcal::client
