#include "client/process/daemon_process.h"

#include <absl/status/status.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <grpcpp/create_channel.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <thread>
#include <utility>

#include "selfcal/v1/rig.grpc.pb.h"

namespace selfcal::client {
namespace {

using namespace std::chrono_literals;

bool Serves(const std::string& target) {
  auto stub = v1::RigService::NewStub(
      grpc::CreateChannel(target, grpc::InsecureChannelCredentials()));
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() + 500ms);
  v1::ListRigsResponse response;
  return stub->ListRigs(&context, {}, &response).ok();
}

std::string EndOfLog(const std::string& path) {
  std::ifstream file(path);
  std::string text(std::istreambuf_iterator<char>(file), {});
  return text.size() > 2000 ? text.substr(text.size() - 2000) : text;
}

pid_t Spawn(const std::string& binary,
            const std::string& state_dir,
            const std::string& log) {
  const pid_t parent = getpid();
  const pid_t pid = fork();
  if (pid != 0) return pid;
  setpgid(0, 0);
  prctl(PR_SET_PDEATHSIG, SIGTERM);
  if (getppid() != parent) _exit(127);
  const int fd = open(log.c_str(), O_WRONLY | O_CREAT | O_APPEND, 0600);
  dup2(fd, STDOUT_FILENO);
  dup2(fd, STDERR_FILENO);
  execl(binary.c_str(),
        binary.c_str(),
        "--state-dir",
        state_dir.c_str(),
        static_cast<char*>(nullptr));
  _exit(127);
}

}  // namespace

absl::StatusOr<std::unique_ptr<DaemonProcess>> DaemonProcess::Start(
    const std::string& binary, const std::string& state_dir) {
  if (!std::filesystem::exists(binary)) {
    return absl::NotFoundError(fmt::format(
        "{} does not exist; it is the program of the package selfcald",
        binary));
  }
  const std::string log = state_dir + ".log";
  const pid_t pid = Spawn(binary, state_dir, log);
  if (pid < 0) return absl::UnavailableError("fork failed");
  std::unique_ptr<DaemonProcess> process(
      new DaemonProcess(pid, fmt::format("unix:{}/selfcald.sock", state_dir)));
  for (int attempt = 0; attempt < 200; ++attempt) {
    if (Serves(process->target_)) return process;
    if (waitpid(pid, nullptr, WNOHANG) == pid) {
      process->pid_ = 0;
      return absl::UnavailableError(
          fmt::format("selfcald ended at once; its log:\n{}", EndOfLog(log)));
    }
    std::this_thread::sleep_for(100ms);
  }
  return absl::UnavailableError(
      fmt::format("selfcald does not serve; its log:\n{}", EndOfLog(log)));
}

DaemonProcess::DaemonProcess(pid_t pid, std::string target)
    : pid_(pid), target_(std::move(target)) {}

DaemonProcess::~DaemonProcess() {
  if (pid_ == 0) return;
  kill(pid_, SIGTERM);
  waitpid(pid_, nullptr, 0);
}

void DaemonProcess::Kill() {
  kill(pid_, SIGKILL);
  waitpid(pid_, nullptr, 0);
  pid_ = 0;
}

}  // namespace selfcal::client
