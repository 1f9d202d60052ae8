// A child process of a test: its stderr goes to a file, and it does not outlive
// the test.
#pragma once

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "test/support/eventually.h"
#include "test/support/files.h"

namespace selfcal::server {

class Process {
 public:
  Process(std::vector<std::string> arguments, std::filesystem::path log)
      : log_(std::move(log)) {
    std::vector<char*> argv;
    for (std::string& argument : arguments) argv.push_back(argument.data());
    argv.push_back(nullptr);
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    for (const int file : {STDOUT_FILENO, STDERR_FILENO}) {
      posix_spawn_file_actions_addopen(
          &actions, file, log_.c_str(), O_WRONLY | O_CREAT | O_APPEND, 0600);
    }
    const int error =
        posix_spawn(&pid_, argv[0], &actions, nullptr, argv.data(), environ);
    posix_spawn_file_actions_destroy(&actions);
    if (error != 0) throw std::runtime_error("cannot start " + arguments[0]);
  }
  ~Process() {
    if (pid_ <= 0) return;
    kill(pid_, SIGKILL);
    waitpid(pid_, nullptr, 0);
  }
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;

  pid_t pid() const { return pid_; }
  void Signal(int signal) const { kill(pid_, signal); }

  // The most memory that it has had resident [MiB].
  int PeakMiB() const {
    std::ifstream status("/proc/" + std::to_string(pid_) + "/status");
    for (std::string word; status >> word;) {
      int kib = 0;
      if (word == "VmHWM:" && status >> kib) return kib >> 10;
    }
    return 0;
  }

  // The exit code, or minus the signal that ended it; nothing if it still runs
  // after a minute.
  std::optional<int> Wait() {
    int status = 0;
    if (!Eventually([&] { return waitpid(pid_, &status, WNOHANG) == pid_; })) {
      return std::nullopt;
    }
    pid_ = 0;
    return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
  }

  std::string Log() const { return ReadBytes(log_); }

  // Whether the log shows the text within a minute; after `first`, if given.
  bool Says(const std::string& text, const std::string& first = "") const {
    return Eventually([&] {
      const std::string log = Log();
      const size_t from = log.find(first);
      return from != log.npos && log.find(text, from) != log.npos;
    });
  }

  // What stands behind the text in the log, to the end of the word.
  std::string Word(const std::string& before) const {
    if (!Says(before)) throw std::runtime_error("not in the log: " + Log());
    const std::string log = Log();
    const size_t at = log.find(before) + before.size();
    return log.substr(at, log.find_first_of(", \n", at) - at);
  }

 private:
  std::filesystem::path log_;
  pid_t pid_ = 0;
};

}  // namespace selfcal::server
