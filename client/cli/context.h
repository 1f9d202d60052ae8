// What every command shares: where the daemon is, how to print, and how errors
// become exit codes.
//
// Exit codes: 0 done; 1 the daemon refused, or what was asked for failed; 2
// wrong usage or unusable input; 3 the daemon cannot be reached; 4 its database
// is damaged.
#pragma once

#include <absl/status/status.h>
#include <google/protobuf/message.h>
#include <grpcpp/grpcpp.h>

#include <chrono>
#include <functional>
#include <memory>
#include <string>
#include <string_view>

#include "client/cli/table.h"
#include "client/cli/target.h"
#include "client/selfcal/client.h"

namespace selfcal::client {

inline constexpr int kDone = 0;
inline constexpr int kFailed = 1;
inline constexpr int kUsage = 2;
inline constexpr int kUnreachable = 3;
inline constexpr int kDamaged = 4;

struct Context {
  Target target;
  bool json = false;
  bool terminal = false;  // stdout is one
  // Set by the command that was named, run once the line is parsed.
  std::function<int()> command;

  // Before the first call, and to forget how the daemon was. Says what is wrong
  // with the target or its files; the daemon need not be there.
  absl::Status Connect();
  // One for all calls from then on.
  std::shared_ptr<grpc::Channel> Channel() const { return channel_; }
  // For what the library connects.
  const ClientOptions& Connection() const { return connection_; }

  void Print(const Table& table) const;
  void Print(const Facts& facts) const;
  // One document, or with `line` one line.
  void PrintJson(const google::protobuf::Message& message,
                 bool line = false) const;

 private:
  ClientOptions connection_;
  std::shared_ptr<grpc::Channel> channel_;
};

// As proto3 JSON with the names of the fields as in the contract, default
// values included.
std::string ToJson(const google::protobuf::Message& message, bool line);

void PrintText(std::string_view text);
void PrintError(std::string_view text);  // "selfcal: text"

// Says on stderr what is wrong, a line for each violated field; returns the
// exit code.
int Fail(const Context& context, const grpc::Status& status);
// For what this side could not read.
int FailInput(const absl::Status& status);

// True for what may pass when the daemon comes back. One that is about to end
// cancels the calls it has.
bool IsUnreachable(const grpc::Status& status);

// A deadline for calls that answer at once.
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
