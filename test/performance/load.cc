#include "test/performance/load.h"

#include <fmt/format.h>

#include <cstdio>
#include <exception>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <utility>

namespace selfcal::client {

void AddLoadOptions(CLI::App* app, LoadOptions* options) {
  app->add_option("--daemon", options->daemon, "selfcald")
      ->required()
      ->check(CLI::ExistingFile);
  app->add_option("--folder", options->folder, "For the daemon's state")
      ->required()
      ->check(CLI::ExistingDirectory);
}

std::unique_ptr<DaemonProcess> StartDaemon(const LoadOptions& options) {
  const std::string state = options.folder + "/load";
  std::filesystem::remove_all(state);
  auto started = DaemonProcess::Start(options.daemon, state);
  if (!started.ok()) throw std::runtime_error(started.status().ToString());
  return *std::move(started);
}

double Seconds(Clock::duration time) {
  return std::chrono::duration<double>(time).count();
}

double StatusOf(pid_t pid, const std::string& name) {
  std::ifstream file(fmt::format("/proc/{}/status", pid));
  for (std::string line; std::getline(file, line);) {
    if (line.starts_with(name + ":")) {
      return std::stod(line.substr(name.size() + 1));
    }
  }
  throw std::runtime_error("the daemon has ended");
}

double Memory(pid_t pid, const std::string& name) {
  return StatusOf(pid, name) / 1024;
}

int RunLoad(const std::function<void()>& load) {
  try {
    load();
  } catch (const std::exception& error) {
    fmt::print(stderr, "{}\n", error.what());
    return 1;
  }
  return 0;
}

}  // namespace selfcal::client
