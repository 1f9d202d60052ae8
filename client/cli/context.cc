#include "client/cli/context.h"

#include <fmt/format.h>
#include <google/protobuf/util/json_util.h>

#include <cstdio>
#include <utility>
#include <vector>

#include "client/cli/list_csv.h"
#include "client/cli/missing_rig.h"
#include "client/selfcal/connection.h"
#include "google/rpc/error_details.pb.h"
#include "google/rpc/status.pb.h"
#include "proto/safe_text.h"

namespace selfcal::client {
namespace {

constexpr std::chrono::seconds kDeadline{30};

// Returns the violated fields from the error's details, a line each.
std::string Violations(const grpc::Status& status, const FlagNames& flags) {
  google::rpc::Status details;
  if (!details.ParseFromString(status.error_details())) return "";
  std::vector<Violation> violations;
  std::size_t more = 0;
  for (const auto& detail : details.details()) {
    google::rpc::BadRequest request;
    if (!detail.Is<google::rpc::BadRequest>() || !detail.UnpackTo(&request)) {
      continue;
    }
    for (const auto& violation : request.field_violations()) {
      // The daemon ends a long list with a number.
      std::size_t count = 0;
      if (violation.field().empty() &&
          std::sscanf(
              violation.description().c_str(), "and %zu more;", &count) == 1) {
        more += count;
      } else {
        violations.push_back(
            {SafeLine(violation.field()), SafeLine(violation.description())});
      }
    }
  }
  return ErrorLines(violations, flags, more);
}

void Write(const std::string& text) {
  std::fwrite(text.data(), 1, text.size(), stdout);
  std::fflush(stdout);
}

// For a table on a terminal.
Layout TerminalLayout(ColorMode color) {
  return {static_cast<std::size_t>(CurrentTerminalSize().columns),
          UsesColor(color, true)};
}

}  // namespace

absl::Status Context::Connect() {
  auto connection = Resolve(target);
  if (!connection.ok()) return connection.status();
  auto channel = MakeChannel(*connection);
  if (!channel.ok()) return channel.status();
  connection_ = *std::move(connection);
  channel_ = *std::move(channel);
  return absl::OkStatus();
}

// The cells are safe; colours are not text.
void Context::Print(const Table& table) const {
  Write(terminal ? table.Aligned(TerminalLayout(color))
                 : table.Tabbed(UsesColor(color, false)));
}

void Context::Print(const Facts& facts) const {
  Write(terminal ? facts.Aligned(TerminalLayout(color))
                 : facts.Tabbed(UsesColor(color, false)));
}

bool Context::PrintList(const google::protobuf::Message& list) const {
  if (csv) {
    Write(ListCsv(list));
  } else if (json) {
    PrintJson(list);
  }
  return csv || json;
}

void Context::PrintJson(const google::protobuf::Message& message,
                        bool line) const {
  Write(ToJson(message, line));
}

std::string ToJson(const google::protobuf::Message& message, bool line) {
  google::protobuf::util::JsonPrintOptions options;
  options.preserve_proto_field_names = true;
  options.always_print_primitive_fields = true;
  options.add_whitespace = !line;
  std::string json;
  const auto status =
      google::protobuf::util::MessageToJsonString(message, &json, options);
  if (!status.ok()) {
    PrintError(fmt::format("cannot write as JSON: {}", status.ToString()));
  }
  if (json.empty() || json.back() != '\n') json += '\n';
  return json;
}

void PrintText(std::string_view text) { Write(SafeLines(text)); }

void PrintError(std::string_view text) {
  const std::string line = fmt::format("selfcal: {}\n", SafeLines(text));
  std::fwrite(line.data(), 1, line.size(), stderr);
}

int Fail(const Context& context, const grpc::Status& status) {
  if (IsUnreachable(status)) {
    PrintError(
        fmt::format("the daemon at {} does not answer: {}\n"
                    "  Is selfcald running? Set another address with --target "
                    "or the environment variable SELFCAL_TARGET.",
                    context.target.address,
                    status.error_message()));
    return kUnreachable;
  }
  const std::string violations = Violations(status, context.flags);
  PrintError(violations.empty()
                 ? SafeLine(status.error_message()) +
                       MissingRigHint(context, status)
                 : "the daemon refused the request:" + violations);
  return kFailed;
}

int FailInput(const absl::Status& status) {
  PrintError(std::string(status.message().data(), status.message().size()));
  return kUsage;
}

bool IsUnreachable(const grpc::Status& status) {
  return status.error_code() == grpc::StatusCode::UNAVAILABLE ||
         status.error_code() == grpc::StatusCode::DEADLINE_EXCEEDED ||
         status.error_code() == grpc::StatusCode::CANCELLED;
}

void SetDeadline(grpc::ClientContext* call) {
  call->set_deadline(std::chrono::system_clock::now() + kDeadline);
}

}  // namespace selfcal::client
