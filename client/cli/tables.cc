#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <memory>
#include <string>

#include "client/cli/commands.h"
#include "client/cli/group_check.h"
#include "client/cli/positive_number.h"
#include "client/text/text.h"
#include "proto/resource_names.h"
#include "selfcal/v1/segment.grpc.pb.h"

namespace selfcal::client {
namespace {

using SegmentService = v1::SegmentService::StubInterface;

struct TableOptions {
  std::string rig;
  std::string group;      // empty: all
  std::size_t limit = 0;  // entries of each; 0: all
};

void PrintTable(const Context& context, const v1::Table& table) {
  PrintText(fmt::format("{}: {} of {}, {} offered{}\n",
                        LastPart(table.name()),
                        table.entries_size(),
                        CountText(table.capacity(), "entry", "entries"),
                        CountText(table.scored(), "segment"),
                        table.starved() ? ", starved" : ""));
  Table rows({{"  #", true}, {"segment"}, {"H [nat]", true}, {"gain", true}});
  int rank = 0;
  for (const auto& entry : table.entries()) {
    rows.Add({fmt::format("{}", ++rank),
              LastPart(entry.segment()),
              fmt::format("{:.3f}", entry.entropy_nats()),
              fmt::format("{:.3f}", entry.gain_nats())});
  }
  context.Print(rows);
  PrintText("\n");
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

// Removes the tables of other groups, and entries beyond the limit.
void Select(const TableOptions& options, v1::ListTablesResponse* tables) {
  auto* const all = tables->mutable_tables();
  all->erase(std::remove_if(all->begin(),
                            all->end(),
                            [&options](const v1::Table& table) {
                              return !options.group.empty() &&
                                     LastPart(table.name()) != options.group;
                            }),
             all->end());
  if (options.limit == 0) return;
  for (v1::Table& table : *all) {
    auto* const entries = table.mutable_entries();
    const int kept = static_cast<int>(std::min<std::size_t>(
        options.limit, static_cast<std::size_t>(entries->size())));
    entries->DeleteSubrange(kept, entries->size() - kept);
  }
}

int ShowTables(Context* context, const TableOptions& options) {
  if (!options.group.empty()) {
    const absl::Status known =
        CheckGroup(*context, options.rig, {"--group", options.group});
    if (!known.ok()) return FailInput(known);
  }
  const auto stub = v1::SegmentService::NewStub(context->Channel());
  v1::ListTablesRequest request;
  request.set_parent(RigName(options.rig));
  v1::ListTablesResponse tables;
  const auto status = Call<SegmentService>(
      stub.get(), &SegmentService::ListTables, request, &tables);
  if (!status.ok()) return Fail(*context, status);
  Select(options, &tables);
  if (context->json) {
    context->PrintJson(tables);
  } else if (context->terminal) {
    for (const v1::Table& table : tables.tables()) PrintTable(*context, table);
  } else {
    context->Print(Records(tables));
  }
  return kDone;
}

}  // namespace

CLI::App* AddTableShow(CLI::App* parent,
                       const std::string& name,
                       Context* context) {
  CLI::App* tables = parent->add_subcommand(
      name, "Show the tables of a rig: its most informative segments");
  const auto options = std::make_shared<TableOptions>();
  tables->add_option("RIG", options->rig)->required();
  tables->add_option("--group", options->group, "Only the table of this group");
  tables
      ->add_option("--limit",
                   options->limit,
                   "Only this many entries of each table, the best [all]")
      ->check(AtLeastOne());
  tables->callback([context, options] {
    context->command = [context, options] {
      return ShowTables(context, *options);
    };
  });
  return tables;
}

void AddTableCommands(CLI::App* app, Context* context) {
  CLI::App* table = app->add_subcommand("table", "Show tables of segments");
  table->require_subcommand(1);
  AddTableShow(table, "show", context);
}

}  // namespace selfcal::client
