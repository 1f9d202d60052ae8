// top: shows the current activity of the daemon, by rig.
#include <algorithm>
#include <chrono>
#include <memory>
#include <optional>

#include "client/cli/commands.h"
#include "client/cli/list_options.h"
#include "client/cli/screen.h"
#include "client/cli/terminal.h"
#include "client/cli/top_view.h"
#include "selfcal/v1/activity_service.grpc.pb.h"

namespace selfcal::client {
namespace {

using ActivityService = v1::ActivityService::StubInterface;

constexpr int kMostRigs = 1000;  // limit of a page

struct TopOptions {
  double interval_s = 2;
  bool once = false;
  int rigs = 50;
};

// Requests the rigs that sent last; the daemon reads only these.
grpc::Status ReadActivity(Context* context,
                          int rigs,
                          v1::ListActivityResponse* activity) {
  const auto stub = v1::ActivityService::NewStub(context->Channel());
  v1::ListActivityRequest request;
  request.set_page_size(rigs);
  return Call<ActivityService>(
      stub.get(), &ActivityService::ListActivity, request, activity);
}

int Snapshot(Context* context, const TopOptions& options) {
  v1::ListActivityResponse activity;
  const grpc::Status status = ReadActivity(context, options.rigs, &activity);
  if (!status.ok()) return Fail(*context, status);
  if (!context->PrintList(activity)) {
    context->Print(ActivityTable(activity, context->terminal));
  }
  return kDone;
}

// Redraws until the user quits or the daemon does not answer.
grpc::Status Draw(Context* context, const TopOptions& options, Screen* screen) {
  const std::chrono::milliseconds interval(
      static_cast<std::int64_t>(1000 * options.interval_s));
  do {
    const TerminalSize size = CurrentTerminalSize();
    v1::ListActivityResponse activity;
    const grpc::Status status = ReadActivity(
        context, std::min(RigsOnScreen(size.rows), kMostRigs), &activity);
    if (!status.ok()) return status;
    if (!screen->Show(ActivityScreen(activity, size.columns, size.rows))) {
      break;
    }
  } while (screen->Wait(interval));
  return grpc::Status::OK;
}

int Top(Context* context, const TopOptions& options) {
  if (options.once || context->json || context->csv || !context->terminal) {
    return Snapshot(context, options);
  }
  grpc::Status status;
  {
    Screen screen;
    status = Draw(context, options, &screen);
  }
  return status.ok() ? kDone : Fail(*context, status);
}

}  // namespace

CLI::App* AddTop(CLI::App* parent, const std::string& name, Context* context) {
  CLI::App* top = parent->add_subcommand(
      name,
      "Show the current activity: the rigs that sent last, streams, tables and "
      "runs. Updates until Ctrl-C on a terminal, prints once into a pipe");
  const auto options = std::make_shared<TopOptions>();
  top->add_option("--interval", options->interval_s, "Seconds between updates")
      ->check(CLI::Range(0.1, 3600.0))
      ->capture_default_str();
  top->add_flag("--once", options->once, "Print once, also on a terminal");
  AddCsv(top, context);
  top->add_option("--rigs",
                  options->rigs,
                  "If printing once: show at most this many rigs, those that "
                  "sent last")
      ->check(CLI::Range(1, kMostRigs))
      ->capture_default_str();
  top->callback([context, options] {
    context->command = [context, options] { return Top(context, *options); };
  });
  return top;
}

}  // namespace selfcal::client
