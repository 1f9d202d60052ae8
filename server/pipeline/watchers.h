// Watchers of a topic, and publication to them.
//
// Each watcher gets its first update on its own thread and the others from the
// publishing threads, one at a time and in order: an update is passed on only
// if it Follows the last one. All watchers of a topic share an update.
#pragma once

#include <absl/status/statusor.h>

#include <algorithm>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "server/pipeline/pipeline.h"
#include "server/pipeline/verdict.h"

namespace selfcal::server {

// The part of the last update that a watcher remembers.
struct LastActivation {
  std::int64_t rig_key = 0;
  std::int64_t activation = 0;
  VerdictKind verdict = VerdictKind::kUnknown;
};
inline LastActivation Remembered(const StoredCalibration& update) {
  return {update.rig_key, update.activation, VerdictOf(update).kind};
}
struct LastRunUpdate {
  RunState state = RunState::kPending;
};
inline LastRunUpdate Remembered(const RunUpdate& update) {
  return {update.run.state};
}

// Each activation of a rig once, in order, and once more if its version ceases
// to be trustworthy while it is active; that is not taken back. The newest one
// need not have the highest version: an older version may have been activated
// again. A rig that was deleted and created again is another one, which the
// watcher may not have the right to see.
inline bool Follows(const LastActivation& last, const StoredCalibration& next) {
  if (next.rig_key != last.rig_key) return false;
  if (next.activation != last.activation) {
    return next.activation > last.activation;
  }
  return last.verdict != VerdictKind::kNotTrustworthy &&
         VerdictOf(next).kind == VerdictKind::kNotTrustworthy;
}

// No update after the end of a run.
inline bool Follows(const LastRunUpdate& last, const RunUpdate& /*next*/) {
  return last.state == RunState::kPending || last.state == RunState::kRunning;
}

// The topic of an update: a rig, or a run of a rig.
inline std::string TopicOf(const StoredCalibration& update) {
  return update.rig;
}
inline std::pair<std::string, std::int64_t> TopicOf(const RunUpdate& update) {
  return {update.run.rig, update.run.run};
}

template <typename Update>
class Watchers {
 public:
  using Topic = decltype(TopicOf(std::declval<const Update&>()));
  using Callback = std::function<void(const std::shared_ptr<const Update>&)>;
  using Observer = std::function<void(const Update&)>;

  // `every` receives each update of every topic before its watchers do; may be
  // empty.
  explicit Watchers(Observer every = nullptr) : every_(std::move(every)) {}

  // Subscribes to `topic`. `now` returns the present state; it is called once
  // the subscription exists, so that nothing is missed in between.
  absl::StatusOr<std::unique_ptr<Subscription>> Watch(
      const Topic& topic,
      Callback callback,
      const std::function<absl::StatusOr<Update>()>& now) {
    auto watcher = std::make_shared<Watcher>();
    watcher->callback = std::move(callback);
    const std::lock_guard lock(watcher->mutex);
    Add(topic, watcher);
    absl::StatusOr<Update> first = now();
    if (!first.ok()) {
      watcher->ended = true;
      return first.status();
    }
    watcher->Notify(std::make_shared<const Update>(*std::move(first)));
    return std::unique_ptr<Subscription>(new Handle(watcher));
  }

  void Publish(Update update) {
    if (every_) every_(update);
    PassOn(std::move(update));
  }

  // Publishes what has happened in another daemon: not to `every`.
  void PassOn(Update update) {
    const auto shared = std::make_shared<const Update>(std::move(update));
    for (const std::shared_ptr<Watcher>& watcher : Living(TopicOf(*shared))) {
      const std::lock_guard lock(watcher->mutex);
      if (!watcher->ended) watcher->Notify(shared);
    }
  }

  bool IsWatched(const Topic& topic) const {
    const std::lock_guard lock(mutex_);
    const auto [begin, end] = watchers_.equal_range(topic);
    return std::any_of(
        begin, end, [](const auto& entry) { return !entry.second.expired(); });
  }
  // Topics that have a watcher.
  std::set<Topic> Topics() const {
    std::set<Topic> topics;
    const std::lock_guard lock(mutex_);
    for (const auto& [topic, watcher] : watchers_) {
      if (!watcher.expired()) topics.insert(topic);
    }
    return topics;
  }

 private:
  struct Watcher {
    std::mutex mutex;  // held while the callback runs
    Callback callback;
    std::optional<decltype(Remembered(std::declval<const Update&>()))> last;
    bool ended = false;

    void Notify(const std::shared_ptr<const Update>& update) {
      if (!last || Follows(*last, *update)) {
        last = Remembered(*update);
        callback(update);
      }
    }
  };

  class Handle : public Subscription {
   public:
    explicit Handle(std::shared_ptr<Watcher> watcher)
        : watcher_(std::move(watcher)) {}
    ~Handle() override {
      const std::lock_guard lock(watcher_->mutex);
      watcher_->ended = true;
      watcher_->callback = nullptr;
    }

   private:
    std::shared_ptr<Watcher> watcher_;
  };

  void Add(const Topic& topic, const std::shared_ptr<Watcher>& watcher) {
    const std::lock_guard lock(mutex_);
    std::erase_if(watchers_,
                  [](const auto& entry) { return entry.second.expired(); });
    watchers_.emplace(topic, watcher);
  }

  // Those of the topic, in the order in which they came.
  std::vector<std::shared_ptr<Watcher>> Living(const Topic& topic) const {
    const std::lock_guard lock(mutex_);
    std::vector<std::shared_ptr<Watcher>> living;
    const auto [begin, end] = watchers_.equal_range(topic);
    for (auto entry = begin; entry != end; ++entry) {
      if (std::shared_ptr<Watcher> watcher = entry->second.lock()) {
        living.push_back(std::move(watcher));
      }
    }
    return living;
  }

  const Observer every_;
  mutable std::mutex mutex_;
  // Guarded by mutex_; may have ended.
  std::multimap<Topic, std::weak_ptr<Watcher>> watchers_;
};

}  // namespace selfcal::server
