#include "server/api/rig_watches.h"

#include <set>
#include <utility>

#include "proto/resource_names.h"
#include "server/api/errors.h"
#include "server/status/status_macros.h"

namespace selfcal::server {
namespace {

constexpr std::size_t kRigsOfQuery = 1000;

void Close(const std::string& rig, const std::weak_ptr<WatchQueue>& watch) {
  const std::shared_ptr<WatchQueue> queue = watch.lock();
  if (queue == nullptr) return;
  const std::string name = RigName(rig);
  queue->Close(
      About(absl::NotFoundError(name + " was deleted; this watch has ended"),
            {kRigType, name, {}}));
}

}  // namespace

absl::StatusOr<std::shared_ptr<void>> RigWatches::Add(
    const std::string& rig, const std::shared_ptr<WatchQueue>& queue) {
  Watches::iterator place;
  {
    const std::lock_guard lock(registered_->mutex);
    place = registered_->watches.emplace(rig, Watch{std::nullopt, queue});
  }
  std::shared_ptr<void> watch(nullptr,
                              [registered = registered_, place](void*) {
                                const std::lock_guard lock(registered->mutex);
                                registered->watches.erase(place);
                              });
  // Read when it is registered: a deletion meanwhile is not missed.
  SELFCAL_ASSIGN_OR_RETURN(const auto keys, store_->GetRigKeys({rig}));
  const auto key = keys.find(rig);
  const std::lock_guard lock(registered_->mutex);
  place->second.rig_key = key == keys.end() ? 0 : key->second;
  return watch;
}

void RigWatches::End(const std::string& rig) {
  for (const auto& [of, watch] : Copy(registered_.get(), rig)) {
    Close(of, watch.queue);
  }
}

std::function<void(const std::string&)> RigWatches::DeletionHandler() const {
  return [store = store_, registered = registered_](const std::string& rig) {
    EndWatchesOfDeletedRig(store, registered.get(), rig);
  };
}

RigWatches::Watches RigWatches::Copy(Registered* registered,
                                     const std::string& rig) {
  const std::lock_guard lock(registered->mutex);
  if (rig.empty()) return registered->watches;
  const auto [begin, end] = registered->watches.equal_range(rig);
  return {begin, end};
}

void RigWatches::EndWatchesOfDeletedRig(Store* store,
                                        Registered* registered,
                                        const std::string& rig) {
  // Before the keys are read: a rig that is created in between has no watch
  // here.
  const Watches watches = Copy(registered, rig);
  auto begin = watches.begin();
  while (begin != watches.end()) {
    std::set<std::string> names;
    auto end = begin;
    for (; end != watches.end() && names.size() < kRigsOfQuery;
         end = watches.upper_bound(end->first)) {
      names.insert(end->first);
    }
    const auto keys = store->GetRigKeys(names);
    if (!keys.ok()) return;
    for (; begin != end; ++begin) {
      const auto& [name, watch] = *begin;
      const auto key = keys->find(name);
      const std::int64_t now = key == keys->end() ? 0 : key->second;
      if (watch.rig_key && *watch.rig_key != now) Close(name, watch.queue);
    }
  }
}

}  // namespace selfcal::server
