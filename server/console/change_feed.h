// Tells open pages that something has changed, so that they read it anew. What
// the pipeline does comes from its observer; what is committed by hand, from
// the log of events, which is looked at while a page is open. Any thread may
// call.
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
  // Hands on to `next`, which may be null. Both outlive it.
  ChangeFeed(Store* store, PipelineObserver* next);
  ~ChangeFeed() override;

  void OnVerdict(const std::string& rig, Verdict verdict) override;
  void OnScore(const SegmentInformation& information, double seconds) override;
  void OnRun(const StoredRun& run) override;
  void OnCheck(CheckSubject subject, VerificationOutcome outcome) override;

  // Server-sent events, from now on; of one rig, or all with an empty name.
  // The feed forgets it when nobody holds it.
  std::shared_ptr<Outbox> Subscribe(const std::string& rig);

 private:
  struct Reader {
    std::string rig;
    std::int64_t newest_event = 0;  // that it needs not be told
    std::weak_ptr<Outbox> outbox;
  };

  void Tell(const std::string& what, const std::string& rig);
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
