// The event feed for open pages: notifies them of changes, so that they read
// again. Changes by the pipeline are reported by its observer; manual changes
// are found in the event log, which is polled while a page is open. Any thread
// may call.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <list>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "server/console/outbox.h"
#include "server/pipeline/observer.h"
#include "server/store/store.h"

namespace selfcal::server {

class ChangeFeed final : public PipelineObserver {
 public:
  // Forwards to `next`, which may be null. Both must outlive the feed.
  ChangeFeed(Store* store, PipelineObserver* next);
  ~ChangeFeed() override;

  void OnVerdict(const std::string& rig, Verdict verdict) override;
  void OnScore(const SegmentInformation& information, double seconds) override;
  void OnRun(const StoredRun& run) override;
  void OnCheck(CheckSubject subject, VerificationOutcome outcome) override;

  // Returns a stream of server-sent events from now on, about one rig or, with
  // an empty name, all rigs. The subscription ends when its last owner releases
  // it.
  std::shared_ptr<Outbox> Subscribe(const std::string& rig);

 private:
  struct Reader {
    std::string rig;
    std::int64_t newest_event = 0;  // events up to this one are not sent
    std::weak_ptr<Outbox> outbox;
  };

  void Notify(const std::string& what, const std::string& rig);
  bool HasReaders();
  void WatchEvents();
  void TellEvents(const std::vector<StoredEvent>& newest);

  Store* store_;
  PipelineObserver* next_;
  std::mutex mutex_;  // guards readers_ and stopping_
  std::condition_variable stop_;
  std::list<Reader> readers_;
  bool stopping_ = false;
  std::thread watcher_;
};

}  // namespace selfcal::server
