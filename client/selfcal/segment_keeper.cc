#include "client/selfcal/segment_keeper.h"

#include <exception>
#include <utility>
#include <variant>
#include <vector>

#include "client/selfcal/queue_limits.h"

namespace selfcal::client {

SegmentKeeper::SegmentKeeper(const ClientOptions& options,
                             SegmentQueue* queue,
                             Refuse refuse)
    : options_(options), queue_(queue), refuse_(std::move(refuse)) {}

void SegmentKeeper::Run() noexcept {
  OpenSpool();
  SegmentQueue::State state = queue_->state();
  while (!state.finishing) {
    if (ProcessNext(state, Clock::now()) != KeeperStep::kWait) {
      state = queue_->state();
    } else {
      state = queue_->WaitForChange(state, spool_.retry_at());
    }
  }
  try {
    SpoolRest();
  } catch (const std::exception&) {  // out of memory: the rest is lost
  }
}

void SegmentKeeper::OpenSpool() {
  spool_ = SpooledSegments::Open(options_);
  queue_->ReportSpool(spool_.report());
}

KeeperStep SegmentKeeper::ProcessNext(const SegmentQueue::State& state,
                                      Clock::time_point now) {
  spool_.RetryIfDue(now);
  const KeeperStep step = NextStep(SituationOf(state));
  try {
    TakeStep(step);
  } catch (const std::exception&) {  // out of memory
    spool_.Block();
    queue_->ReportSpool(spool_.report());
  }
  return step;
}

void SegmentKeeper::SpoolRest() {
  if (!spool_.exists()) return;
  RemoveFiles();
  while (const auto oldest = queue_->TakeOldest()) {
    if (!oldest->on_disk && !spool_.Write(*oldest)) return;
  }
  while (true) {
    while (!encoded_.has_value()) {
      if (queue_->state().incoming == 0) return;
      EncodeIncoming();
    }
    if (!WriteToSpool()) return;
  }
}

KeeperSituation SegmentKeeper::SituationOf(
    const SegmentQueue::State& state) const {
  KeeperSituation now;
  now.has_finished_files = state.finished_files > 0;
  now.has_incoming = state.incoming > 0;
  now.has_encoded = encoded_.has_value();
  now.window_is_empty = state.in_window == 0;
  now.window_has_room =
      state.in_window < MaxInWindow(options_, spool_.exists());
  now.memory_has_room = state.in_memory < MaxInMemory(options_);
  now.has_unloaded = spool_.report().has_unloaded;
  now.spool_is_usable = spool_.exists() && !spool_.blocked();
  return now;
}

void SegmentKeeper::TakeStep(KeeperStep step) {
  switch (step) {
    case KeeperStep::kWait:
      break;
    case KeeperStep::kRemoveFiles:
      RemoveFiles();
      break;
    case KeeperStep::kEncode:
      EncodeIncoming();
      break;
    case KeeperStep::kAppend:
      queue_->Append(std::move(*encoded_));
      encoded_.reset();
      break;
    case KeeperStep::kSpool:
      WriteToSpool();
      break;
    case KeeperStep::kLoad:
      Load();
      break;
  }
}

void SegmentKeeper::RemoveFiles() {
  spool_.Remove(queue_->TakeFinishedFiles());
  queue_->ReportSpool(spool_.report());
}

void SegmentKeeper::EncodeIncoming() {
  auto incoming = queue_->TakeIncoming();
  if (!incoming.has_value()) return;
  std::variant<EncodedSegment, Acknowledgement> result;
  try {
    AssemblyStatistics counts;
    result = Encode(options_.rig, *std::move(incoming), &counts);
    queue_->NoteAssembled(counts);
  } catch (const std::exception&) {
    queue_->NoteDropped();
    throw;
  }
  if (auto* encoded = std::get_if<EncodedSegment>(&result)) {
    encoded->number = spool_.NextNumber();
    encoded_ = std::move(*encoded);
  } else {
    queue_->NoteRefused();
    refuse_(std::get<Acknowledgement>(result));
  }
}

// Writes the encoded segment to disk; the keeper keeps it if that fails.
bool SegmentKeeper::WriteToSpool() {
  if (!spool_.Write(*encoded_)) {
    queue_->ReportSpool(spool_.report());
    return false;
  }
  encoded_.reset();
  queue_->NoteSpooled(spool_.report());
  return true;
}

void SegmentKeeper::Load() {
  if (!queue_->ReserveRoom()) return;  // a segment has come meanwhile
  auto loaded = spool_.ReadUnloaded();
  if (loaded.has_value()) {
    const std::uint64_t number = loaded->number;
    queue_->Append(*std::move(loaded));
    spool_.MarkLoaded(number);
  }
  queue_->ReportSpool(spool_.report());
}

}  // namespace selfcal::client
