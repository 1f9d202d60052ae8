// The common part of programs that put a real daemon under load.
#pragma once

#include <sys/types.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <functional>
#include <memory>
#include <string>

#include "client/process/daemon_process.h"

namespace selfcal::client {

using Clock = std::chrono::steady_clock;

struct LoadOptions {
  std::string daemon;  // the program
  std::string folder;  // for its state
};

void AddLoadOptions(CLI::App* app, LoadOptions* options);

// Starts the daemon on an empty state folder. Throws if it does not start.
std::unique_ptr<DaemonProcess> StartDaemon(const LoadOptions& options);

double Seconds(Clock::duration time);

// The number on a line of /proc/PID/status: KiB, or a count. Throws if the
// daemon has ended.
double StatusOf(pid_t pid, const std::string& name);
// The same in MiB.
double Memory(pid_t pid, const std::string& name);

// Runs `load`, and returns the exit code: 1 if it throws, with the message on
// stderr.
int RunLoad(const std::function<void()>& load);

}  // namespace selfcal::client
