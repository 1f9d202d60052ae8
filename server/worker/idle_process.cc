#include "server/worker/idle_process.h"

#include <sched.h>
#include <spdlog/spdlog.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

namespace selfcal::server {
namespace {

// Constants of linux/ioprio.h, which programs should not include.
constexpr int kWhoProcess = 1;
constexpr int kClassIdle = 3;
constexpr int kClassShift = 13;

}  // namespace

void BecomeIdle() {
  const sched_param parameters{};
  if (sched_setscheduler(0, SCHED_IDLE, &parameters) != 0) {
    spdlog::warn("the run does not have idle CPU priority: {}",
                 std::strerror(errno));
  }
  if (syscall(SYS_ioprio_set, kWhoProcess, 0, kClassIdle << kClassShift) != 0) {
    spdlog::warn("the run does not have idle I/O priority: {}",
                 std::strerror(errno));
  }
}

void LowerPriority() {
  constexpr int kNiceness = 10;
  if (setpriority(PRIO_PROCESS, 0, kNiceness) != 0) {
    spdlog::warn("the run has normal priority: {}", std::strerror(errno));
  }
}

}  // namespace selfcal::server
