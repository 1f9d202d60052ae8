#include <unistd.h>

#include <cstdio>
#include <exception>

#include "client/cli/commands.h"

namespace selfcal::client {
namespace {

constexpr char kFooter[] =
    "On a terminal the output is a table. In a pipe it is one record per line, "
    "its fields\nseparated by tabs, without a header. With --json it is the "
    "contract's message in\nproto3 JSON: one document, or one line each for "
    "import,\ncalibrations watch, runs watch, coach --watch, verify and "
    "doctor.\n\n"
    "Exit codes: 0 success; 1 the daemon refused, the operation failed, or "
    "preflight\nor verify found something; 2 wrong usage or unusable input; 3 "
    "the daemon\ncannot be reached; 4 doctor found damage.";

void AddGlobalOptions(CLI::App* app, Context* context) {
  app->set_version_flag("--version", "selfcal " SELFCAL_VERSION);
  Target& target = context->target;
  app->add_option("--target",
                  target.address,
                  "The daemon: unix:/path, host:port (with TLS), or "
                  "insecure:host:port (without)")
      ->envname("SELFCAL_TARGET")
      ->capture_default_str();
  app->add_option("--ca",
                  target.ca_file,
                  "For host:port: the authority of the daemon's certificate "
                  "(PEM)")
      ->envname("SELFCAL_CA");
  app->add_option("--cert",
                  target.certificate_file,
                  "For host:port: your certificate (PEM)")
      ->envname("SELFCAL_CERT");
  app->add_option("--key", target.key_file, "For host:port: its key (PEM)")
      ->envname("SELFCAL_KEY");
  app->add_flag("--json", context->json, "Print JSON");
  app->require_subcommand(1);
  app->fallthrough();  // global options may also follow the command
  app->footer(kFooter);
}

}  // namespace

int RunCommandLine(int argc, const char* const* argv) {
  try {
    Context context;
    context.terminal = isatty(STDOUT_FILENO) == 1;
    CLI::App app("selfcal feeds and inspects selfcald.", "selfcal");
    AddGlobalOptions(&app, &context);
    AddRigCommands(&app, &context);
    AddImportCommand(&app, &context);
    AddPreflightCommand(&app, &context);
    AddSegmentCommands(&app, &context);
    AddSessionCommands(&app, &context);
    AddTablesCommand(&app, &context);
    AddRecalibrateCommand(&app, &context);
    AddRunCommands(&app, &context);
    AddCalibrationCommands(&app, &context);
    AddReportCommand(&app, &context);
    AddCoachCommand(&app, &context);
    AddVerifyCommand(&app, &context);
    AddTopCommand(&app, &context);
    AddEventsCommand(&app, &context);
    AddDoctorCommand(&app, &context);
    AddBackupCommand(&app, &context);
    AddRestoreCommand(&app, &context);
    AddCompletionCommand(&app, &context);
    try {
      app.parse(argc, argv);
    } catch (const CLI::ParseError& error) {
      return app.exit(error) == 0 ? kDone : kUsage;
    }
    const absl::Status connected = context.Connect();
    if (!connected.ok()) return FailInput(connected);
    const int code = context.command();
    if (code == kDone && (std::fflush(stdout) != 0 || std::ferror(stdout))) {
      PrintError("the output could not be written");
      return kFailed;
    }
    return code;
  } catch (const std::exception& error) {
    PrintError(error.what());
    return kFailed;
  }
}

}  // namespace selfcal::client
