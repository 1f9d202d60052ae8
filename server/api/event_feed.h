// Reports that something has changed, so that whoever shows it reads it again.
// Changes by the pipeline come from its observer. The store is polled while
// there is a reader: for events, and for segments that other daemons store or
// devices report. Any thread may call.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <functional>
#include <list>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <tuple>
#include <vector>

#include "selfcal/v1/activity_service.pb.h"
#include "server/pipeline/observer.h"
#include "server/store/store.h"

namespace selfcal::server {

class EventFeed final : public PipelineObserver {
 public:
  // Forwards to `next`, which may be null. Both must outlive the feed.
  EventFeed(Store* store, PipelineObserver* next);
  ~EventFeed() override;

  void OnVerdict(const std::string& rig, Verdict verdict) override;
  void OnScore(const SegmentInformation& information, double seconds) override;
  void OnRun(const StoredRun& run) override;
  void OnCheck(CheckSubject subject, VerificationOutcome outcome) override;

  // Reports changes from now on, about one rig or, with an empty name, all
  // rigs; `rig` is empty in a change that may concern any. The callback returns
  // at once. The subscription ends when its last owner releases it, and may
  // outlive the feed.
  using OnChange =
      std::function<void(v1::Change::What what, const std::string& rig)>;
  std::shared_ptr<void> Subscribe(const std::string& rig, OnChange on_change);

 private:
  // Steady time, rig and number: identify an event.
  using EventId = std::tuple<std::int64_t, std::string, std::int64_t>;
  using EventIds = std::set<EventId>;
  // Times at which the rigs were last seen that were seen last.
  using Seen = std::map<std::string, std::int64_t>;

  struct Reader {
    std::string rig;
    // Its newest events, when it was last looked for some: among those of all
    // rigs, one may come before others that were committed earlier.
    std::shared_ptr<const EventIds> known;
    std::shared_ptr<const Seen> seen;
    OnChange on_change;
  };

  static EventId IdOf(const StoredEvent& event);
  static EventIds IdsOf(const std::vector<StoredEvent>& events);

  void Notify(v1::Change::What what, const std::string& rig);
  // The readers that exist; with the lock held.
  std::vector<std::shared_ptr<Reader>> Readers();
  void Poll();
  // Reads those of the rig, or of all if it is empty; nullopt if they cannot be
  // read now.
  std::optional<Seen> ReadSeen(const std::string& rig);
  // `newest` are the newest events of the rig, or of all if it is empty.
  void NotifyOfEvents(const std::string& rig,
                      const std::vector<StoredEvent>& newest);
  // `notified` are rigs of whose segments readers know already.
  void NotifyOfSegments(const std::string& rig,
                        const Seen& seen,
                        const std::set<std::string>& notified);

  Store* store_;
  PipelineObserver* next_;
  std::mutex mutex_;  // guards what follows
  std::condition_variable stop_;
  std::list<std::weak_ptr<Reader>> readers_;
  // Rigs of which the pipeline stored segments since they were last polled.
  std::set<std::string> stored_;
  bool stopping_ = false;
  std::thread poller_;
};

}  // namespace selfcal::server
