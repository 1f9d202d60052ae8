#include "server/api/event_feed.h"

#include <chrono>
#include <utility>

namespace selfcal::server {
namespace {

constexpr std::chrono::milliseconds kPollInterval{500};
constexpr int kEvents = 50;  // number of events that a poll reads
// Rigs are polled less often: their list costs more, and the segments that the
// pipeline stores are reported at once.
constexpr int kPollsOfEvents = 4;  // for each poll of rigs
constexpr int kRigs = 20;

}  // namespace

EventFeed::EventFeed(Store* store, PipelineObserver* next)
    : store_(store), next_(next), poller_([this] { Poll(); }) {}

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
  if (verdict != Verdict::kStored) return;
  {
    const std::lock_guard lock(mutex_);
    stored_.insert(rig);
  }
  Notify(v1::Change::SEGMENTS, rig);
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
  auto seen = std::make_shared<const Seen>(ReadSeen(rig).value_or(Seen()));
  auto reader = std::make_shared<Reader>(
      Reader{rig, std::move(known), std::move(seen), std::move(on_change)});
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

void EventFeed::Poll() {
  std::unique_lock lock(mutex_);
  int polls = 0;
  while (!stop_.wait_for(lock, kPollInterval, [this] { return stopping_; })) {
    std::set<std::string> rigs;
    for (const auto& reader : Readers()) rigs.insert(reader->rig);
    const bool of_segments = ++polls % kPollsOfEvents == 0;
    std::set<std::string> notified;
    if (of_segments) notified.swap(stored_);
    lock.unlock();
    for (const std::string& rig : rigs) {
      // If the store fails now, the next poll tries again.
      const auto events = store_->ListNewestEvents({kEvents, ""}, rig);
      if (events.ok()) NotifyOfEvents(rig, events->items);
      if (!of_segments) continue;
      const auto seen = ReadSeen(rig);
      if (seen) NotifyOfSegments(rig, *seen, notified);
    }
    lock.lock();
  }
}

std::optional<EventFeed::Seen> EventFeed::ReadSeen(const std::string& rig) {
  const auto rigs = store_->ListRigSummaries(
      {.order = RigQuery::Order::kLastSeen, .descending = true, .name = rig},
      {kRigs, ""});
  if (!rigs.ok()) return std::nullopt;
  Seen seen;
  for (const RigSummary& one : rigs->items) seen[one.rig] = one.last_seen_ns;
  return seen;
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

void EventFeed::NotifyOfSegments(const std::string& rig,
                                 const Seen& seen,
                                 const std::set<std::string>& notified) {
  const auto now = std::make_shared<const Seen>(seen);
  const std::lock_guard lock(mutex_);
  for (const auto& reader : Readers()) {
    if (reader->rig != rig) continue;
    int newer = 0;
    for (const auto& [id, last_seen_ns] : seen) {
      const auto before = reader->seen->find(id);
      if (before != reader->seen->end() && before->second == last_seen_ns) {
        continue;
      }
      ++newer;
      if (!notified.contains(id)) reader->on_change(v1::Change::SEGMENTS, id);
    }
    // There may be others beyond these.
    if (newer == kRigs) reader->on_change(v1::Change::EVERYTHING, "");
    reader->seen = now;
  }
}

}  // namespace selfcal::server
