// sessions: lists the sessions of a rig, and shows the path of one.
#include <fmt/format.h>

#include <memory>
#include <string>

#include "client/cli/commands.h"
#include "client/cli/filter_command.h"
#include "client/cli/list_options.h"
#include "client/text/text.h"
#include "proto/resource_names.h"
#include "selfcal/v1/session.grpc.pb.h"

namespace selfcal::client {
namespace {

using SessionService = v1::SessionService::StubInterface;

std::vector<FilterField> SessionFields() {
  using Kind = FilterField::Kind;
  return {{"session"},
          {"segments", Kind::kNumber},
          {"first", Kind::kTime},
          {"last", Kind::kTime}};
}

FieldValue ValueOf(const v1::Session& session, std::string_view field) {
  if (field == "session") return LastPart(session.name());
  if (field == "first") return FilterTime(session.first_receive_time());
  if (field == "last") return FilterTime(session.last_receive_time());
  return static_cast<double>(session.segments());
}

int ListSessions(Context* context,
                 const std::string& rig,
                 const ListOptions& options) {
  const auto wanted = Wanted<v1::Session>(options, SessionFields(), ValueOf);
  if (!wanted.ok()) return FailInput(wanted.status());
  const auto stub = v1::SessionService::NewStub(context->Channel());
  v1::ListSessionsRequest request;
  request.set_parent(RigName(rig));
  v1::ListSessionsResponse sessions;
  const auto status =
      CallForItems<SessionService>(stub.get(),
                                   &SessionService::ListSessions,
                                   request,
                                   &v1::ListSessionsResponse::mutable_sessions,
                                   options.limit,
                                   wanted->test,
                                   &sessions);
  if (!status.ok()) return Fail(*context, status);
  if (context->PrintList(sessions)) return kDone;
  Table table({{"session"}, {"segments", true}, {"first"}, {"last"}});
  for (const v1::Session& session : sessions.sessions()) {
    table.Add({LastPart(session.name()),
               fmt::format("{}", session.segments()),
               TimeText(session.first_receive_time()),
               TimeText(session.last_receive_time())});
  }
  context->Print(table);
  return kDone;
}

// The path, as a table with a row for each point.
int ShowSession(Context* context,
                const std::string& rig,
                const std::string& session) {
  const auto stub = v1::SessionService::NewStub(context->Channel());
  v1::GetTrajectoryRequest request;
  request.set_name(RigName(rig) + "/sessions/" + LastPart(session));
  v1::SessionTrajectory trajectory;
  const auto status = CallForAllPages<SessionService>(
      stub.get(), &SessionService::GetTrajectory, request, &trajectory);
  if (!status.ok()) return Fail(*context, status);
  if (context->json) {
    context->PrintJson(trajectory);
    return kDone;
  }
  constexpr double kNanoseconds = 1e-9;
  Table table({{"segment"},
               {"time [s]", true},
               {"x [m]", true},
               {"y [m]", true},
               {"z [m]", true}});
  for (const v1::TrajectorySegment& segment : trajectory.segments()) {
    for (int k = 0; k < segment.seconds_size(); ++k) {
      const auto metres = [&](int axis) {
        return fmt::format("{:.3f}", segment.positions_m(3 * k + axis));
      };
      table.Add(
          {LastPart(segment.segment()),
           fmt::format("{:.3f}",
                       kNanoseconds * static_cast<double>(segment.start_ns()) +
                           segment.seconds(k)),
           metres(0),
           metres(1),
           metres(2)});
    }
  }
  context->Print(table);
  return kDone;
}

}  // namespace

void AddSessionCommands(CLI::App* app, Context* context) {
  CLI::App* sessions =
      app->add_subcommand("session", "Show sessions")->alias("sessions");
  sessions->require_subcommand(1);
  const auto rig = std::make_shared<std::string>();
  const auto session = std::make_shared<std::string>();
  CLI::App* list = sessions->add_subcommand(
      "list", "List the sessions of a rig that have stored segments");
  list->add_option("RIG", *rig)->required();
  const auto options = std::make_shared<ListOptions>();
  AddListOptions(list,
                 context,
                 "the first of the list",
                 FilterHelp("last >= 2d AND segments > 3", SessionFields()),
                 options.get());
  list->callback([context, rig, options] {
    context->command = [context, rig, options] {
      return ListSessions(context, *rig, *options);
    };
  });
  CLI::App* show = sessions->add_subcommand(
      "show", "Show the path of a session, in its frame and by its clock");
  show->add_option("RIG", *rig)->required();
  show->add_option("SESSION", *session, "As in the list")->required();
  show->callback([context, rig, session] {
    context->command = [context, rig, session] {
      return ShowSession(context, *rig, *session);
    };
  });
}

}  // namespace selfcal::client
