// The context that all commands share: the connection to the daemon, output,
// and the conversion of errors into exit codes.
//
// Exit codes: 0 success; 1 the daemon refused the request, or the operation
// failed; 2 wrong usage, unusable input, or an output file that exists or
// cannot be written; 3 the daemon cannot be reached; 4 its database is damaged;
// 5 the calibration is weak.
#pragma once

#include <absl/status/status.h>
#include <google/protobuf/message.h>
#include <grpcpp/grpcpp.h>

#include <chrono>
#include <functional>
#include <memory>
#include <string>
#include <string_view>

#include "client/cli/error_lines.h"
#include "client/cli/table.h"
#include "client/cli/target.h"
#include "client/cli/terminal.h"
#include "client/selfcal/client.h"

namespace selfcal::client {

inline constexpr int kDone = 0;
inline constexpr int kFailed = 1;
inline constexpr int kUsage = 2;
inline constexpr int kUnreachable = 3;
inline constexpr int kDamaged = 4;
inline constexpr int kWeak = 5;

struct Context {
  Target target;
  bool json = false;
  bool csv = false;       // of a list
  bool terminal = false;  // true if stdout is a terminal
  ColorMode color = ColorMode::kAuto;
  // Names of fields of the request in errors of the daemon.
  FlagNames flags = {{"filter", "--filter"},
                     {"order_by", "--order-by"},
                     {"parent", "RIG"},
                     {"reason", "--reason"}};
  // The command to run; set while the command line is parsed.
  std::function<int()> command;

  // Creates the channel; needed before the first call. A later call replaces
  // the channel and its connection state. Returns an error if the target or its
  // files are invalid; the daemon need not be running.
  absl::Status Connect();
  // The channel for all calls since Connect.
  std::shared_ptr<grpc::Channel> Channel() const { return channel_; }
  // The options for connections of the client library.
  const ClientOptions& Connection() const { return connection_; }

  void Print(const Table& table) const;
  void Print(const Facts& facts) const;
  // Prints a list as JSON or as CSV; false if neither is wanted.
  bool PrintList(const google::protobuf::Message& list) const;
  // Prints one document or, with `line`, one line.
  void PrintJson(const google::protobuf::Message& message,
                 bool line = false) const;

 private:
  ClientOptions connection_;
  std::shared_ptr<grpc::Channel> channel_;
};

// Converts to proto3 JSON, with the field names of the contract and with
// default values.
std::string ToJson(const google::protobuf::Message& message, bool line);

// Control characters other than line breaks and tabs become '?' in both.
void PrintText(std::string_view text);
void PrintError(std::string_view text);  // prints "selfcal: text"

// Prints the error to stderr, with a line for each violated field; returns the
// exit code.
int Fail(const Context& context, const grpc::Status& status);
// Does the same for input that cannot be read and files that cannot be written.
int FailInput(const absl::Status& status);

// True for errors that may end when the daemon is back. CANCELLED is one of
// them, because a daemon that shuts down cancels its calls.
bool IsUnreachable(const grpc::Status& status);

// Sets the deadline for calls that answer at once.
void SetDeadline(grpc::ClientContext* call);

// Calls `method` of `stub` once.
template <typename Stub, typename Request, typename Response>
grpc::Status Call(Stub* stub,
                  grpc::Status (Stub::*method)(grpc::ClientContext*,
                                               const Request&,
                                               Response*),
                  const Request& request,
                  Response* response) {
  grpc::ClientContext call;
  SetDeadline(&call);
  return (stub->*method)(&call, request, response);
}

// Calls a list method until its last page; *all has the items of every page
// and no page token.
template <typename Stub, typename Request, typename Response>
grpc::Status CallForAllPages(Stub* stub,
                             grpc::Status (Stub::*method)(grpc::ClientContext*,
                                                          const Request&,
                                                          Response*),
                             Request request,
                             Response* all) {
  constexpr int kPageSize = 500;
  request.set_page_size(kPageSize);
  do {
    Response page;
    grpc::Status status = Call(stub, method, request, &page);
    if (!status.ok()) return status;
    request.set_page_token(page.next_page_token());
    page.clear_next_page_token();
    all->MergeFrom(page);
  } while (!request.page_token().empty());
  return grpc::Status::OK;
}

}  // namespace selfcal::client
