// estimate list: parameters of versions, over time and over rigs.
#include <fmt/format.h>

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "client/cli/commands.h"
#include "client/cli/list_options.h"
#include "client/text/text.h"
#include "proto/resource_names.h"
#include "selfcal/v1/fleet.grpc.pb.h"

namespace selfcal::client {
namespace {

using FleetService = v1::FleetService::StubInterface;

struct EstimateOptions {
  std::string rig;  // empty: all rigs
  std::string component;
  bool only_active = false;
  ListOptions list;
};

int List(Context* context, const EstimateOptions& options) {
  const auto stub = v1::FleetService::NewStub(context->Channel());
  v1::ListEstimatesRequest request;
  if (!options.rig.empty()) request.set_parent(RigName(options.rig));
  request.set_component(options.component);
  request.set_only_active(options.only_active);
  request.set_filter(options.list.filter);
  v1::ListEstimatesResponse estimates;
  const auto status =
      CallForItems<FleetService>(stub.get(),
                                 &FleetService::ListEstimates,
                                 request,
                                 &v1::ListEstimatesResponse::mutable_estimates,
                                 options.list.limit,
                                 nullptr,
                                 &estimates);
  if (!status.ok()) return Fail(*context, status);
  if (context->PrintList(estimates)) return kDone;
  Table table({{"rig"},
               {"version", true},
               {"state"},
               {"created"},
               {"component"},
               {"value", true},
               {"sigma", true},
               {"from factory", true},
               {"unit"}});
  const auto number = [](bool is_there, double value) {
    return is_there ? fmt::format("{:.6g}", value) : std::string("-");
  };
  for (const v1::Estimate& estimate : estimates.estimates()) {
    table.Add({LastPart(estimate.rig()),
               fmt::format("{}", estimate.version()),
               StateText(estimate.state()),
               TimeText(estimate.create_time()),
               estimate.component(),
               number(true, estimate.value()),
               number(estimate.has_sigma(), estimate.sigma()),
               number(estimate.has_from_factory(), estimate.from_factory()),
               estimate.unit()});
  }
  context->Print(table);
  return kDone;
}

}  // namespace

void AddEstimateCommands(CLI::App* app, Context* context) {
  CLI::App* estimate =
      app->add_subcommand("estimate", "Show parameters over time and rigs")
          ->alias("estimates");
  estimate->require_subcommand(1);
  CLI::App* list = estimate->add_subcommand(
      "list",
      "List the parameters of the versions of a rig, or of all rigs of a "
      "filter");
  const auto options = std::make_shared<EstimateOptions>();
  list->add_option("RIG", options->rig);
  list->add_option("--component",
                   options->component,
                   "Only this parameter, e.g. cam0.focal.x");
  list->add_flag(
      "--active", options->only_active, "Only of the active versions");
  list->add_option("--filter",
                   options->list.filter,
                   "Only rigs that match, e.g. 'labels.batch = \"2026-10\"'");
  list->add_option("--limit", options->list.limit, "Only the first; 0: all");
  AddCsv(list, context);
  list->callback([context, options] {
    context->command = [context, options] { return List(context, *options); };
  });
}

}  // namespace selfcal::client
