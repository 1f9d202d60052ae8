// daemon: what concerns the daemon as a whole.
#include "client/cli/commands.h"

namespace selfcal::client {

void AddDaemonCommands(CLI::App* app, Context* context) {
  CLI::App* daemon =
      app->add_subcommand(
             "daemon",
             "Show what the daemon does; check, back up, restore its data")
          ->alias("daemons");
  daemon->require_subcommand(1);
  AddTop(daemon, "top", context);
  AddDoctor(daemon, "doctor", context);
  AddBackup(daemon, "backup", context);
  AddRestore(daemon, "restore", context);
}

}  // namespace selfcal::client
