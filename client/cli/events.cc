// event list: lists the event log.
#include <fmt/format.h>
#include <google/protobuf/util/time_util.h>

#include <algorithm>
#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "client/cli/choice.h"
#include "client/cli/commands.h"
#include "client/cli/filter_command.h"
#include "client/cli/list_options.h"
#include "client/cli/time_input.h"
#include "client/text/text.h"
#include "proto/resource_names.h"
#include "selfcal/v1/store_service.grpc.pb.h"

namespace selfcal::client {
namespace {

using google::protobuf::Timestamp;
using google::protobuf::util::TimeUtil;
using StoreService = v1::StoreService::StubInterface;

constexpr int kPageSize = 500;

struct EventOptions {
  std::string rig;                 // empty: all rigs
  std::vector<std::string> kinds;  // as KindName returns them; empty: all
  std::string since;
  ListOptions list;
};

using EventTest = std::function<bool(const v1::Event&)>;

// Returns e.g. "data-evicted".
std::string KindName(v1::Event::Kind kind) {
  std::string name = KindText(kind);
  std::replace(name.begin(), name.end(), ' ', '-');
  return name;
}

std::vector<std::string> KindNames() {
  return WordsOf<v1::Event::Kind>(v1::Event::Kind_descriptor(), KindText);
}

std::vector<FilterField> EventFields() {
  using Kind = FilterField::Kind;
  return {{"event", Kind::kNumber},
          {"time", Kind::kTime},
          {"rig"},
          {"kind", Kind::kText, KindNames()},
          {"detail"}};
}

FieldValue ValueOf(const v1::Event& event, std::string_view field) {
  if (field == "event") return static_cast<double>(event.number());
  if (field == "time") return FilterTime(event.time());
  if (field == "rig") return event.rig().empty() ? "-" : LastPart(event.rig());
  if (field == "kind") return KindName(event.kind());
  return event.detail();
}

bool IsWanted(const v1::Event& event,
              const EventOptions& options,
              const std::optional<Timestamp>& since,
              const EventTest& meets_filter) {
  if (since && event.time() < *since) return false;
  if (meets_filter && !meets_filter(event)) return false;
  return options.kinds.empty() ||
         std::find(options.kinds.begin(),
                   options.kinds.end(),
                   KindName(event.kind())) != options.kinds.end();
}

// Reads page by page, so that a long history needs no more memory than the
// events that are wanted.
grpc::Status Read(Context* context,
                  const EventOptions& options,
                  const std::optional<Timestamp>& since,
                  const EventTest& meets_filter,
                  std::deque<v1::Event>* events) {
  const auto stub = v1::StoreService::NewStub(context->Channel());
  v1::ListEventsRequest request;
  if (!options.rig.empty()) request.set_parent(RigName(options.rig));
  request.set_rig_filter(options.list.rigs);
  request.set_page_size(kPageSize);
  do {
    v1::ListEventsResponse page;
    const grpc::Status status = Call<StoreService>(
        stub.get(), &StoreService::ListEvents, request, &page);
    if (!status.ok()) return status;
    for (const v1::Event& event : page.events()) {
      if (IsWanted(event, options, since, meets_filter)) {
        events->push_back(event);
      }
      if (options.list.limit > 0 && events->size() > options.list.limit) {
        events->pop_front();
      }
    }
    request.set_page_token(page.next_page_token());
  } while (!request.page_token().empty());
  return grpc::Status::OK;
}

void PrintEvents(const Context& context, const std::deque<v1::Event>& events) {
  v1::ListEventsResponse document;
  for (const v1::Event& event : events) *document.add_events() = event;
  if (context.PrintList(document)) return;
  Table table(
      {{"event", true}, {"time"}, {"rig"}, {"kind"}, {"detail", false, true}});
  for (const v1::Event& event : document.events()) {
    table.Add({fmt::format("{}", event.number()),
               TimeText(event.time()),
               LastPart(event.rig()),
               KindText(event.kind()),
               event.detail()});
  }
  context.Print(table);
}

int ListEvents(Context* context, const EventOptions& options) {
  std::optional<Timestamp> since;
  if (!options.since.empty()) {
    const auto time = ParseTime(options.since, TimeUtil::GetCurrentTime());
    if (!time.ok()) {
      return FailInput(absl::InvalidArgumentError(
          "--since: " + std::string(time.status().message())));
    }
    since = *time;
  }
  const auto wanted = Wanted<v1::Event>(options.list, EventFields(), ValueOf);
  if (!wanted.ok()) return FailInput(wanted.status());
  std::deque<v1::Event> events;
  const grpc::Status status =
      Read(context, options, since, wanted->test, &events);
  if (!status.ok()) return Fail(*context, status);
  PrintEvents(*context, events);
  return kDone;
}

}  // namespace

CLI::App* AddEventList(CLI::App* parent,
                       const std::string& name,
                       Context* context) {
  CLI::App* events = parent->add_subcommand(
      name, "List the events of one rig or of all, oldest first");
  const auto options = std::make_shared<EventOptions>();
  CLI::Option* const rig = events->add_option("RIG", options->rig);
  events->add_option("--kind", options->kinds, "Only this kind; repeatable")
      ->check(OneOf(KindNames()));
  events->add_option("--since",
                     options->since,
                     "Only since 2026-11-21, '2026-11-21 04:10:03' (UTC), or "
                     "30s, 15m, 2h, 7d ago");
  AddListOptions(
      events,
      context,
      "the newest",
      FilterHelp("kind = data-evicted AND rig != tablet-7", EventFields()),
      &options->list);
  AddRigFilter(events, rig, &options->list);
  events->callback([context, options] {
    context->command = [context, options] {
      return ListEvents(context, *options);
    };
  });
  return events;
}

void AddEventCommands(CLI::App* app, Context* context) {
  CLI::App* event = app->add_subcommand("event", "Show the event log");
  event->require_subcommand(1);
  AddEventList(event, "list", context);
}

}  // namespace selfcal::client
