#include <fmt/format.h>

#include <memory>
#include <string>

#include "client/cli/commands.h"
#include "client/text/text.h"
#include "proto/resource_names.h"
#include "selfcal/v1/segment.grpc.pb.h"

namespace selfcal::client {
namespace {

using SegmentService = v1::SegmentService::StubInterface;

void PrintTable(const v1::Table& table) {
  PrintText(fmt::format("{}: {} of {} entries, {} segments offered{}\n",
                        LastPart(table.name()),
                        table.entries_size(),
                        table.capacity(),
                        table.scored(),
                        table.starved() ? ", starved" : ""));
  Table rows({{"  #", true}, {"segment"}, {"H [nat]", true}, {"gain", true}});
  int rank = 0;
  for (const auto& entry : table.entries()) {
    rows.Add({fmt::format("{}", ++rank),
              LastPart(entry.segment()),
              fmt::format("{:.3f}", entry.entropy_nats()),
              fmt::format("{:.3f}", entry.gain_nats())});
  }
  PrintText(rows.Aligned() + "\n");
}

// One line per entry: group, rank, segment, entropy, gain.
Table Records(const v1::ListTablesResponse& tables) {
  Table rows({{"group"}, {"#"}, {"segment"}, {"entropy"}, {"gain"}});
  for (const v1::Table& table : tables.tables()) {
    int rank = 0;
    for (const auto& entry : table.entries()) {
      rows.Add({LastPart(table.name()),
                fmt::format("{}", ++rank),
                LastPart(entry.segment()),
                fmt::format("{:.6f}", entry.entropy_nats()),
                fmt::format("{:.6f}", entry.gain_nats())});
    }
  }
  return rows;
}

int ListTables(Context* context, const std::string& rig) {
  const auto stub = v1::SegmentService::NewStub(context->Channel());
  v1::ListTablesRequest request;
  request.set_parent(RigName(rig));
  v1::ListTablesResponse tables;
  const auto status = Call<SegmentService>(
      stub.get(), &SegmentService::ListTables, request, &tables);
  if (!status.ok()) return Fail(*context, status);
  if (context->json) {
    context->PrintJson(tables);
  } else if (context->terminal) {
    for (const v1::Table& table : tables.tables()) PrintTable(table);
  } else {
    context->Print(Records(tables));
  }
  return kDone;
}

}  // namespace

void AddTablesCommand(CLI::App* app, Context* context) {
  CLI::App* tables = app->add_subcommand(
      "tables", "Show the tables of a rig: its most informative segments");
  const auto rig = std::make_shared<std::string>();
  tables->add_option("RIG", *rig)->required();
  tables->callback([context, rig] {
    context->command = [context, rig] { return ListTables(context, *rig); };
  });
}

}  // namespace selfcal::client
