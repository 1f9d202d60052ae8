#include "server/daemon/options.h"

#include <CLI/CLI.hpp>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "proto/nearest_word.h"
#include "server/daemon/config_file.h"
#include "server/daemon/settings.h"

namespace selfcal::server {
namespace {

constexpr int kUsageError = 2;

// The command line, with the environment as its default.
class CommandLine {
 public:
  explicit CommandLine(DaemonOptions* options) {
    app_.set_version_flag("--version", "selfcald " SELFCAL_VERSION);
    app_.add_option("--config", file_, "TOML file with the settings below")
        ->envname("SELFCAL_CONFIG");
    app_.add_flag("--check",
                  options->check,
                  "Check the settings and the files they name, and exit");
    DefineSettings(&app_, Environment::kUse, options);
  }

  std::optional<int> Parse(int argc, char** argv) {
    try {
      app_.parse(argc, argv);
    } catch (const CLI::ParseError& error) {
      const int code = app_.exit(error);
      if (code == 0) return 0;
      SuggestFlags();
      return kUsageError;
    }
    return std::nullopt;
  }

  const std::string& file() const { return file_; }

 private:
  // Suggests a flag for each unknown word.
  void SuggestFlags() const {
    std::vector<std::string> known;
    for (const CLI::Option* option : app_.get_options()) {
      known.push_back("--" + option->get_single_name());
    }
    for (const std::string& word : app_.remaining()) {
      const std::string flag = word.substr(0, word.find('='));
      const std::string nearest = NearestWord(flag, known);
      if (nearest.empty()) continue;
      std::fprintf(stderr,
                   "there is no flag '%s'; did you mean '%s'?\n",
                   flag.c_str(),
                   nearest.c_str());
    }
  }

  CLI::App app_{
      "selfcald scores motion segments, keeps the most informative ones and "
      "calibrates cameras and IMU with them."};
  std::string file_;
};

int CommandLineMistake(const std::string& what) {
  std::fprintf(stderr, "%s\n", what.c_str());
  return kUsageError;
}

std::string FolderOfTheServiceManager(const char* variable) {
  const char* folder = std::getenv(variable);
  return folder == nullptr ? "" : folder;
}

}  // namespace

std::optional<int> ParseOptions(int argc, char** argv, DaemonOptions* options) {
  // Parses the command line once, for its errors and the name of the file, and
  // again after the file, so that it takes precedence.
  DaemonOptions without_file;
  CommandLine first(&without_file);
  if (const auto exit_code = first.Parse(argc, argv)) return exit_code;
  if (!first.file().empty()) {
    const absl::Status applied = ApplyConfigFile(first.file(), options);
    if (!applied.ok())
      return CommandLineMistake(std::string(applied.message()));
  }
  CommandLine again(options);
  if (const auto exit_code = again.Parse(argc, argv)) return exit_code;

  if (options->state_dir.empty()) {
    options->state_dir = FolderOfTheServiceManager("STATE_DIRECTORY");
  }
  if (options->state_dir.empty()) {
    return CommandLineMistake("state-dir is not set: use --state-dir FOLDER");
  }
  if (options->server.listen.empty()) {
    const std::string runtime = FolderOfTheServiceManager("RUNTIME_DIRECTORY");
    const auto folder =
        runtime.empty() ? options->state_dir : std::filesystem::path(runtime);
    const auto socket = std::filesystem::absolute(folder) / "selfcald.sock";
    options->server.listen.push_back("unix:" + socket.string());
  }
  return std::nullopt;
}

}  // namespace selfcal::server
