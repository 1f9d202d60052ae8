#include "server/console/change_feed.h"

#include <chrono>
#include <utility>

#include "proto/resource_names.h"

namespace selfcal::server {
namespace {

constexpr std::chrono::milliseconds kLookAfter{500};
constexpr std::size_t kEvents = 50;  // number of events that a poll reads

// The arguments have no characters that JSON would escape.
std::string Line(const std::string& what, const std::string& rig) {
  return "event: change\ndata: {\"what\":\"" + what + "\",\"rig\":\"" +
         (rig.empty() ? "" : RigName(rig)) + "\"}\n\n";
}

}  // namespace

ChangeFeed::ChangeFeed(Store* store, PipelineObserver* next)
    : store_(store), next_(next), watcher_([this] { WatchEvents(); }) {}

ChangeFeed::~ChangeFeed() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  stop_.notify_all();
  watcher_.join();
}

void ChangeFeed::OnVerdict(const std::string& rig, Verdict verdict) {
  if (next_ != nullptr) next_->OnVerdict(rig, verdict);
  if (verdict == Verdict::kStored) Notify("segments", rig);
}

void ChangeFeed::OnScore(const SegmentInformation& information,
                         double seconds) {
  if (next_ != nullptr) next_->OnScore(information, seconds);
  Notify("scores", "");
}

void ChangeFeed::OnRun(const StoredRun& run) {
  if (next_ != nullptr) next_->OnRun(run);
  Notify("runs", run.rig);
}

void ChangeFeed::OnCheck(CheckSubject subject, VerificationOutcome outcome) {
  if (next_ != nullptr) next_->OnCheck(subject, outcome);
}

std::shared_ptr<Outbox> ChangeFeed::Subscribe(const std::string& rig) {
  auto outbox = std::make_shared<Outbox>(Line("everything", ""));
  // Sent at once, so that the page knows that its stream is connected.
  outbox->Put(Line("everything", ""));
  const auto events = store_->ListNewestEvents({1, ""});
  const bool known = events.ok() && !events->items.empty();
  const std::lock_guard lock(mutex_);
  readers_.push_back({rig, known ? events->items[0].event : 0, outbox});
  return outbox;
}

void ChangeFeed::Notify(const std::string& what, const std::string& rig) {
  const std::lock_guard lock(mutex_);
  for (auto reader = readers_.begin(); reader != readers_.end();) {
    const auto outbox = reader->outbox.lock();
    if (outbox == nullptr) {
      reader = readers_.erase(reader);
      continue;
    }
    if (rig.empty() || reader->rig.empty() || reader->rig == rig) {
      outbox->Put(Line(what, rig));
    }
    ++reader;
  }
}

bool ChangeFeed::HasReaders() {
  const std::lock_guard lock(mutex_);
  readers_.remove_if([](const Reader& r) { return r.outbox.expired(); });
  return !readers_.empty();
}

void ChangeFeed::WatchEvents() {
  std::unique_lock lock(mutex_);
  while (!stop_.wait_for(lock, kLookAfter, [this] { return stopping_; })) {
    lock.unlock();
    if (HasReaders()) {
      // If the store fails, the next poll tries again.
      const auto events =
          store_->ListNewestEvents({static_cast<int>(kEvents), ""});
      if (events.ok() && !events->items.empty()) TellEvents(events->items);
    }
    lock.lock();
  }
}

void ChangeFeed::TellEvents(const std::vector<StoredEvent>& newest) {
  const std::lock_guard lock(mutex_);
  for (Reader& reader : readers_) {
    const auto outbox = reader.outbox.lock();
    if (outbox == nullptr) continue;
    const bool more = newest.size() == kEvents &&
                      newest.back().event > reader.newest_event + 1;
    if (more && reader.newest_event > 0) outbox->Put(Line("everything", ""));
    for (const StoredEvent& event : newest) {
      if (event.event <= reader.newest_event) break;
      if (reader.rig.empty() || reader.rig == event.rig) {
        outbox->Put(Line("events", event.rig));
      }
    }
    reader.newest_event = newest.front().event;
  }
}

}  // namespace selfcal::server
