#include "server/api/event_feed.h"

#include <chrono>
#include <utility>

namespace selfcal::server {
namespace {

constexpr std::chrono::milliseconds kPollInterval{500};
constexpr int kEvents = 50;  // number of events that a poll reads

}  // namespace

EventFeed::EventFeed(Store* store, PipelineObserver* next)
    : store_(store), next_(next), poller_([this] { PollEvents(); }) {}

EventFeed::~EventFeed() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  stop_.notify_all();
  poller_.join();
}

void EventFeed::OnVerdict(const std::string& rig, Verdict verdict) {
  if (next_ != nullptr) next_->OnVerdict(rig, verdict);
  if (verdict == Verdict::kStored) Notify(v1::Change::SEGMENTS, rig);
}

void EventFeed::OnScore(const SegmentInformation& information, double seconds) {
  if (next_ != nullptr) next_->OnScore(information, seconds);
  Notify(v1::Change::SCORES, "");
}

void EventFeed::OnRun(const StoredRun& run) {
  if (next_ != nullptr) next_->OnRun(run);
  Notify(v1::Change::RUNS, run.rig);
}

void EventFeed::OnCheck(CheckSubject subject, VerificationOutcome outcome) {
  if (next_ != nullptr) next_->OnCheck(subject, outcome);
}

std::shared_ptr<void> EventFeed::Subscribe(const std::string& rig,
                                           OnChange on_change) {
  const auto events = store_->ListNewestEvents({kEvents, ""}, rig);
  auto known = std::make_shared<const EventIds>(
      events.ok() ? IdsOf(events->items) : EventIds());
  auto reader = std::make_shared<Reader>(
      Reader{rig, std::move(known), std::move(on_change)});
  const std::lock_guard lock(mutex_);
  readers_.push_back(reader);
  return reader;
}

std::vector<std::shared_ptr<EventFeed::Reader>> EventFeed::Readers() {
  std::vector<std::shared_ptr<Reader>> readers;
  std::erase_if(readers_, [&](const std::weak_ptr<Reader>& weak) {
    auto reader = weak.lock();
    if (reader == nullptr) return true;
    readers.push_back(std::move(reader));
    return false;
  });
  return readers;
}

void EventFeed::Notify(v1::Change::What what, const std::string& rig) {
  const std::lock_guard lock(mutex_);
  for (const auto& reader : Readers()) {
    if (rig.empty() || reader->rig.empty() || reader->rig == rig) {
      reader->on_change(what, rig);
    }
  }
}

void EventFeed::PollEvents() {
  std::unique_lock lock(mutex_);
  while (!stop_.wait_for(lock, kPollInterval, [this] { return stopping_; })) {
    std::set<std::string> rigs;
    for (const auto& reader : Readers()) rigs.insert(reader->rig);
    lock.unlock();
    for (const std::string& rig : rigs) {
      // If the store fails now, the next poll tries again.
      const auto events = store_->ListNewestEvents({kEvents, ""}, rig);
      if (events.ok()) NotifyOfEvents(rig, events->items);
    }
    lock.lock();
  }
}

EventFeed::EventId EventFeed::IdOf(const StoredEvent& event) {
  return {event.steady_ns, event.rig, event.event};
}

EventFeed::EventIds EventFeed::IdsOf(const std::vector<StoredEvent>& events) {
  EventIds ids;
  for (const StoredEvent& event : events) ids.insert(IdOf(event));
  return ids;
}

void EventFeed::NotifyOfEvents(const std::string& rig,
                               const std::vector<StoredEvent>& newest) {
  const auto ids = std::make_shared<const EventIds>(IdsOf(newest));
  const std::lock_guard lock(mutex_);
  for (const auto& reader : Readers()) {
    if (reader->rig != rig) continue;
    // Between the events that are known and these there may be others.
    const bool more = std::ssize(newest) == kEvents &&
                      !reader->known->empty() &&
                      !reader->known->contains(IdOf(newest.back()));
    if (more) reader->on_change(v1::Change::EVERYTHING, "");
    for (const StoredEvent& event : newest) {
      if (reader->known->contains(IdOf(event))) continue;
      reader->on_change(v1::Change::EVENTS, event.rig);
    }
    reader->known = ids;
  }
}

}  // namespace selfcal::server
