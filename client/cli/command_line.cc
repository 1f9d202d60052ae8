#include <unistd.h>

#include <cstdio>
#include <exception>
#include <memory>
#include <sstream>
#include <string>
#include <vector>

#include "client/cli/choice.h"
#include "client/cli/commands.h"
#include "client/cli/old_spellings.h"
#include "client/cli/usage_errors.h"

namespace selfcal::client {
namespace {

constexpr char kFooter[] =
    "On a terminal the output is a table that fits its width. In a pipe it is "
    "one record\nper line, its fields separated by tabs, without a header. "
    "With --json it is the\ncontract's message in proto3 JSON: one document, "
    "or one line each for\nsegment import, calibration watch, run watch, "
    "rig coach --watch, rig verify and\ndaemon doctor. Lists are CSV with "
    "--csv.\n\n"
    "Exit codes: 0 success; 1 the daemon refused, the operation failed, or "
    "segment\npreflight or rig verify found something; 2 wrong usage, unusable "
    "input, or a file\nthat exists or cannot be written; 3 the daemon cannot "
    "be "
    "reached; 4 daemon doctor\nfound damage; 5 calibrate has a weak result.";

// Help shows a command under its name alone.
class Formatter final : public CLI::Formatter {
 public:
  std::string make_subcommand(const CLI::App* command) const override {
    std::ostringstream line;
    CLI::detail::format_help(line,
                             command->get_name(),
                             command->get_description(),
                             get_column_width());
    return line.str();
  }
};

void AddGlobalOptions(CLI::App* app, Context* context) {
  app->set_version_flag("-V,-v,--version", "selfcal " SELFCAL_VERSION);
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
  app->add_option_function<std::string>(
         "--color",
         [context](const std::string& when) {
           context->color = when == "always"  ? ColorMode::kAlways
                            : when == "never" ? ColorMode::kNever
                                              : ColorMode::kAuto;
         },
         "Colours: auto (on a terminal, unless NO_COLOR is set), always or "
         "never")
      ->check(OneOf({"auto", "always", "never"}))
      ->default_str("auto");
  app->require_subcommand(1);
  app->fallthrough();  // global options may also follow the command
  app->footer(kFooter);
}

void AddHelpCommands(CLI::App* app, Context* context) {
  CLI::App* help = app->add_subcommand("help", "Show the help of a command");
  const auto words = std::make_shared<std::vector<std::string>>();
  help->add_option("COMMAND", *words, "e.g. rig create");
  help->callback([app, context, words] {
    context->command = [app, words] { return ShowHelp(*app, *words); };
  });
  CLI::App* version = app->add_subcommand("version", "Show the version");
  version->group("");  // what others call --version
  version->callback([context] {
    context->command = [] {
      PrintText("selfcal " SELFCAL_VERSION "\n");
      return kDone;
    };
  });
}

// The last argument of a command has the name that its request is about.
void NameTheSubject(const CLI::App& app, Context* context) {
  const CLI::App* command = &app;
  while (!command->get_subcommands().empty()) {
    command = command->get_subcommands().back();
  }
  for (const CLI::Option* option : command->get_options()) {
    if (option->get_positional()) {
      context->flags["name"] = option->get_single_name();
    }
  }
}

}  // namespace

int RunCommandLine(int argc, const char* const* argv) {
  try {
    Context context;
    context.terminal = isatty(STDOUT_FILENO) == 1;
    CLI::App app("selfcal feeds and inspects selfcald.", "selfcal");
    app.formatter(std::make_shared<Formatter>());
    AddGlobalOptions(&app, &context);
    AddCalibrate(&app, &context);
    AddTrack(&app, &context);
    AddRigCommands(&app, &context);
    AddSegmentCommands(&app, &context);
    AddSessionCommands(&app, &context);
    AddTableCommands(&app, &context);
    AddRunCommands(&app, &context);
    AddCalibrationCommands(&app, &context);
    AddCohortCommands(&app, &context);
    AddEstimateCommands(&app, &context);
    AddInstructionCommands(&app, &context);
    AddEventCommands(&app, &context);
    AddDaemonCommands(&app, &context);
    AddCompletionCommand(&app, &context);
    AddHelpCommands(&app, &context);
    AddOldSpellings(&app, &context);
    try {
      app.parse(argc, argv);
    } catch (const CLI::ParseError& error) {
      return ReportUsage(&app, error);
    }
    if (context.csv && context.json) {
      return FailInput(absl::InvalidArgumentError(
          "--csv and --json exclude each other: give one of them"));
    }
    NameTheSubject(app, &context);
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
