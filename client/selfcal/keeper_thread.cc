#include "client/selfcal/keeper_thread.h"

#include <sched.h>
#include <sys/resource.h>
#include <unistd.h>

#include <utility>

namespace selfcal::client {
namespace {

// Prevents this thread from preempting the thread that wakes it, which is the
// SLAM system's. Without the permission to do so, it continues as it is.
void LowerPriority() {
  constexpr int kNice = 10;
  const sched_param parameters{};
  sched_setscheduler(0, SCHED_BATCH, &parameters);
  setpriority(PRIO_PROCESS, static_cast<id_t>(gettid()), kNice);
}

}  // namespace

KeeperThread::KeeperThread(const ClientOptions& options,
                           SegmentQueue* queue,
                           SegmentKeeper::Refuse refuse)
    : queue_(queue),
      keeper_(options, queue, std::move(refuse)),
      thread_([this] {
        LowerPriority();
        keeper_.Run();
      }) {}

KeeperThread::~KeeperThread() {
  queue_->Finish();
  thread_.join();
}

}  // namespace selfcal::client
