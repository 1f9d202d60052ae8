// rig attention: the rigs that an operator should look at.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <memory>
#include <string>

#include "client/cli/commands.h"
#include "client/cli/list_options.h"
#include "client/text/text.h"
#include "selfcal/v1/activity_service.grpc.pb.h"

namespace selfcal::client {
namespace {

using ActivityService = v1::ActivityService::StubInterface;

int ShowAttention(Context* context, const ListOptions& options) {
  const auto stub = v1::ActivityService::NewStub(context->Channel());
  v1::ListActivityRequest request;
  request.set_filter(options.filter);
  request.set_order_by("alarms desc");
  request.set_with_alarms(true);
  v1::ListActivityResponse activity;
  const auto status =
      CallForItems<ActivityService>(stub.get(),
                                    &ActivityService::ListActivity,
                                    request,
                                    &v1::ListActivityResponse::mutable_rigs,
                                    options.limit,
                                    nullptr,
                                    &activity);
  if (!status.ok()) return Fail(*context, status);
  if (context->PrintList(activity)) return kDone;
  Table table(
      {{"rig"}, {"last seen"}, {"version", true}, {"alarms", false, true}});
  for (const v1::RigActivity& rig : activity.rigs()) {
    table.Add({LastPart(rig.name()),
               TimeText(rig.last_seen()),
               fmt::format("{}", rig.active_version()),
               fmt::format("{}", fmt::join(rig.alarms(), "; "))});
  }
  context->Print(table);
  return kDone;
}

}  // namespace

void AddAttention(CLI::App* rig, Context* context) {
  CLI::App* attention = rig->add_subcommand(
      "attention", "List the rigs that have alarms, the most urgent first");
  const auto options = std::make_shared<ListOptions>();
  attention->add_option(
      "--filter",
      options->filter,
      "Only rigs that match, e.g. 'labels.batch = \"2026-10\"'");
  attention->add_option("--limit", options->limit, "Only the first; 0: all");
  AddCsv(attention, context);
  attention->callback([context, options] {
    context->command = [context, options] {
      return ShowAttention(context, *options);
    };
  });
}

}  // namespace selfcal::client
