#include <fmt/format.h>

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "client/cli/commands.h"
#include "client/cli/device_reports.h"
#include "client/cli/list_options.h"
#include "client/cli/rig_text.h"
#include "client/text/text.h"
#include "proto/resource_names.h"
#include "selfcal/v1/rig.grpc.pb.h"

namespace selfcal::client {
namespace {

using RigService = v1::RigService::StubInterface;

struct RigListOptions {
  ListOptions list;
  std::string order_by;
};

std::string LabelsText(const v1::Rig& rig) {
  const std::map<std::string, std::string> labels(rig.labels().begin(),
                                                  rig.labels().end());
  std::string text;
  for (const auto& [name, value] : labels) {
    text += (text.empty() ? "" : " ") + name + "=" + value;
  }
  return text;
}

int ListRigs(Context* context, const RigListOptions& options) {
  const auto stub = v1::RigService::NewStub(context->Channel());
  v1::ListRigsRequest request;
  request.set_filter(options.list.filter);
  request.set_order_by(options.order_by);
  v1::ListRigsResponse rigs;
  const auto status =
      CallForItems<RigService>(stub.get(),
                               &RigService::ListRigs,
                               request,
                               &v1::ListRigsResponse::mutable_rigs,
                               options.list.limit,
                               nullptr,
                               &rigs);
  if (!status.ok()) return Fail(*context, status);
  if (context->PrintList(rigs)) return kDone;
  Table table({{"rig"},
               {"cameras", true},
               {"table size", true},
               {"created"},
               {"labels"}});
  for (const v1::Rig& rig : rigs.rigs()) {
    table.Add({LastPart(rig.name()),
               fmt::format("{}", rig.factory().cameras_size()),
               fmt::format("{}", rig.table_size()),
               TimeText(rig.create_time()),
               LabelsText(rig)});
  }
  context->Print(table);
  return kDone;
}

int ShowRig(Context* context, const std::string& id) {
  const auto stub = v1::RigService::NewStub(context->Channel());
  v1::GetRigRequest request;
  request.set_name(RigName(id));
  v1::Rig rig;
  const auto status =
      Call<RigService>(stub.get(), &RigService::GetRig, request, &rig);
  if (!status.ok()) return Fail(*context, status);
  std::optional<v1::ReportState> reports;
  if (!context->json) reports = ReadDeviceReports(*context, id);
  PrintRig(*context, rig, reports);
  return kDone;
}

}  // namespace

void AddRigCommands(CLI::App* app, Context* context) {
  CLI::App* rig =
      app->add_subcommand("rig", "Create and show rigs")->alias("rigs");
  rig->require_subcommand(1);

  AddRigCreation(rig, context);

  CLI::App* list = rig->add_subcommand("list", "List the rigs");
  const auto list_options = std::make_shared<RigListOptions>();
  AddListOptions(list,
                 context,
                 "the first of the list",
                 "Conditions joined by AND, e.g. 'phone AND labels.batch = 7': "
                 "a text in the name; fields: name, labels.NAME",
                 &list_options->list);
  list->add_option("--order-by",
                   list_options->order_by,
                   "name or last_seen, then asc or desc");
  list->callback([context, list_options] {
    context->command = [context, list_options] {
      return ListRigs(context, *list_options);
    };
  });

  AddImuPresets(rig, context);
  AddRigUpdate(rig, context);
  AddRigDeletion(rig, context);
  AddAttention(rig, context);

  CLI::App* show = rig->add_subcommand("show", "Show a rig");
  const auto id = std::make_shared<std::string>();
  show->add_option("RIG", *id)->required();
  show->callback([context, id] {
    context->command = [context, id] { return ShowRig(context, *id); };
  });
  AddCoach(rig, "coach", context);
  AddVerify(rig, "verify", context);
}

}  // namespace selfcal::client
