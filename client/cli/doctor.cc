// doctor: checks the integrity of the daemon's database.
#include <fmt/format.h>

#include <string>

#include "client/cli/commands.h"
#include "client/text/text.h"
#include "selfcal/v1/store_service.grpc.pb.h"

namespace selfcal::client {
namespace {

void PrintChecks(const Context& context,
                 const v1::CheckStoreResponse::Problem& problem) {
  Table line({{""}, {""}, {""}});
  line.Add({"problem", problem.place(), problem.description()});
  context.Print(line);
}

void PrintChecks(const Context& context,
                 const v1::CheckStoreResponse::Summary& summary) {
  Facts facts;
  facts.Add("database", BytesText(summary.bytes()));
  facts.Add("checksums", fmt::format("{}", summary.checksums()));
  facts.Add("segments with data", fmt::format("{}", summary.payloads()));
  facts.Add("problems", fmt::format("{}", summary.problems()));
  context.Print(facts);
}

int Doctor(Context* context) {
  const auto stub = v1::StoreService::NewStub(context->Channel());
  grpc::ClientContext call;
  const auto reader = stub->CheckStore(&call, v1::CheckStoreRequest());
  v1::CheckStoreResponse response;
  bool damaged = false;
  bool whole = false;
  while (reader->Read(&response)) {
    damaged = damaged || response.has_problem();
    if (response.has_summary()) {
      whole = true;
      damaged = damaged || response.summary().problems() > 0;
    }
    if (context->json) {
      context->PrintJson(response, /*line=*/true);
    } else if (response.has_problem()) {
      PrintChecks(*context, response.problem());
    } else {
      PrintChecks(*context, response.summary());
    }
  }
  const grpc::Status status = reader->Finish();
  int code = kDone;
  if (!status.ok()) {
    code = Fail(*context, status);
    damaged = damaged || status.error_code() == grpc::StatusCode::DATA_LOSS;
  } else if (!whole) {
    PrintError("the check ended without a summary: try again");
    code = kFailed;
  }
  return damaged ? kDamaged : code;
}

}  // namespace

CLI::App* AddDoctor(CLI::App* parent,
                    const std::string& name,
                    Context* context) {
  CLI::App* doctor = parent->add_subcommand(
      name,
      "Check the daemon's database while the daemon runs: structure, "
      "references, every checksum, the data of every segment. Exits with 0 if "
      "it is intact, with 4 if it is damaged, with another code if the check "
      "failed");
  doctor->callback(
      [context] { context->command = [context] { return Doctor(context); }; });
  return doctor;
}

}  // namespace selfcal::client
