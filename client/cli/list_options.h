// Options of the list commands, --limit, --filter and --order-by, and the calls
// with them.
#pragma once

#include <google/protobuf/repeated_field.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstddef>
#include <functional>
#include <string>
#include <type_traits>
#include <utility>

#include "client/cli/context.h"

namespace selfcal::client {

struct ListOptions {
  std::size_t limit = 0;  // 0: all
  std::string filter;
  std::string rigs;  // a filter of rigs, for a list of many
  std::string order_by;
};

// Adds --csv, of a command that calls Context::PrintList.
void AddCsv(CLI::App* list, Context* context);

// Adds --limit, of which `order` says the items that remain ("the newest"),
// --filter, and --csv.
void AddListOptions(CLI::App* list,
                    Context* context,
                    const std::string& order,
                    const std::string& filter_help,
                    ListOptions* options);

// Adds --order-by, whose help begins "A field, then asc or desc".
void AddOrderBy(CLI::App* list, const std::string& help, ListOptions* options);

// Adds --rigs, of a list that is of one rig, the option `rig`, or of many.
void AddRigFilter(CLI::App* list, CLI::Option* rig, ListOptions* options);

// Calls a list method page by page until there are `limit` items, or all if it
// is 0, that `wanted` accepts (all without it); *found has these alone, and no
// page token. `items` is the field of the response.
template <typename Stub, typename Request, typename Response, typename Item>
grpc::Status CallForItems(
    Stub* stub,
    grpc::Status (Stub::*method)(grpc::ClientContext*,
                                 const Request&,
                                 Response*),
    Request request,
    google::protobuf::RepeatedPtrField<Item>* (Response::*items)(),
    std::size_t limit,
    const std::type_identity_t<std::function<bool(const Item&)>>& wanted,
    Response* found) {
  constexpr std::size_t kPageSize = 500;
  const bool few = limit > 0 && !wanted;
  request.set_page_size(
      static_cast<int>(few ? std::min(limit, kPageSize) : kPageSize));
  auto* const all = (found->*items)();
  do {
    Response page;
    grpc::Status status = Call(stub, method, request, &page);
    if (!status.ok()) return status;
    for (Item& item : *(page.*items)()) {
      if (wanted && !wanted(item)) continue;
      *all->Add() = std::move(item);
      if (static_cast<std::size_t>(all->size()) == limit) return status;
    }
    request.set_page_token(page.next_page_token());
  } while (!request.page_token().empty());
  return grpc::Status::OK;
}

}  // namespace selfcal::client
