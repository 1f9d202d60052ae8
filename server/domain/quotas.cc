#include "server/domain/quotas.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <string>
#include <vector>

#include "server/domain/exclusion.h"
#include "server/status/status_macros.h"
#include "server/store/database_size.h"
#include "server/store/events.h"
#include "server/store/rigs.h"
#include "server/store/segment_rows.h"

namespace selfcal::server {
namespace {

// Share of the database reserved for scores, runs and calibrations.
constexpr double kReservedPart = 0.1;
constexpr double kFreePart = 0.05;  // of the disk: more need not stay free
constexpr int kMaxDropped = 200;
// Segments beyond a quota go when there are so many of them, or a tenth of the
// quota: an event for each would outgrow what goes.
constexpr std::int64_t kMostAtOnce = 100;

absl::Status CheckDatabaseSize(UnitOfWork* tx,
                               std::int64_t bytes,
                               const Quotas& quotas) {
  if (quotas.max_database_bytes == 0) return absl::OkStatus();
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t used, UsedBytes(tx));
  const auto open = static_cast<std::int64_t>(
      (1 - kReservedPart) * static_cast<double>(quotas.max_database_bytes));
  if (used + bytes <= open) return absl::OkStatus();
  return absl::ResourceExhaustedError(fmt::format(
      "the database holds {} of at most {} bytes, of which a tenth is kept for "
      "results: raise max-database-bytes, or set a quota by rig",
      used,
      quotas.max_database_bytes));
}

absl::Status CheckDisk(UnitOfWork* tx,
                       std::int64_t bytes,
                       const Quotas& quotas) {
  if (quotas.min_free_bytes == 0) return absl::OkStatus();
  SELFCAL_ASSIGN_OR_RETURN(const std::optional<DiskSpace> disk, DiskOf(tx));
  if (!disk) return absl::OkStatus();
  const auto least = std::min(
      quotas.min_free_bytes,
      static_cast<std::int64_t>(kFreePart * static_cast<double>(disk->bytes)));
  if (disk->free_bytes - bytes >= least) return absl::OkStatus();
  return absl::ResourceExhaustedError(fmt::format(
      "the disk of the database has {} bytes free, and {} stay free for other "
      "programs: make room, set a quota by rig, or lower min-free-bytes",
      disk->free_bytes,
      least));
}

// The segment whose data is the least informative: one in no table, or else the
// one whose largest gain in a table is the smallest; the older one of equals.
// Removes those that an unfinished run needs from `holders`.
std::vector<DataHolder>::iterator LeastInformative(
    std::vector<DataHolder>* holders) {
  const auto end =
      std::remove_if(holders->begin(), holders->end(), [](const auto& holder) {
        return holder.in_unfinished_run;
      });
  holders->erase(end, holders->end());
  return std::min_element(
      holders->begin(), holders->end(), [](const auto& a, const auto& b) {
        return a.gain < b.gain;  // nullopt is less than any value
      });
}

absl::Status Evict(UnitOfWork* tx,
                   const DataHolder& holder,
                   const Quotas& quotas) {
  const std::string why = fmt::format(
      "its data of {} bytes was evicted for newer segments: the data of a rig "
      "is limited to {} bytes",
      holder.bytes,
      quotas.max_payload_bytes_per_rig);
  const std::int64_t segment = holder.segment.sequence;
  SELFCAL_RETURN_IF_ERROR(WriteProblem(tx, segment, why));
  SELFCAL_RETURN_IF_ERROR(
      LeaveTables(tx, segment, {.cause = ExclusionCause::kDataEvicted}));
  SELFCAL_RETURN_IF_ERROR(DeleteData(tx, segment));
  return AppendEvent(
      tx,
      EventKind::kDataEvicted,
      fmt::format("{}: {}", SegmentText(tx->rig(), holder.segment.key), why));
}

}  // namespace

absl::Status CheckRigQuota(UnitOfWork* tx, const Quotas& quotas) {
  if (quotas.max_rigs == 0) return absl::OkStatus();
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t rigs, CountRigs(tx));
  if (rigs <= quotas.max_rigs) return absl::OkStatus();
  return absl::ResourceExhaustedError(
      "there are as many rigs as the setting max-rigs allows; ask the operator "
      "to raise it");
}

absl::Status MakeRoom(UnitOfWork* tx,
                      std::int64_t bytes,
                      const Quotas& quotas) {
  SELFCAL_RETURN_IF_ERROR(CheckDatabaseSize(tx, bytes, quotas));
  SELFCAL_RETURN_IF_ERROR(CheckDisk(tx, bytes, quotas));
  const std::int64_t limit = quotas.max_payload_bytes_per_rig;
  if (limit == 0) return absl::OkStatus();
  SELFCAL_ASSIGN_OR_RETURN(std::int64_t used, DataBytes(tx));
  if (used + bytes <= limit) return absl::OkStatus();
  SELFCAL_ASSIGN_OR_RETURN(std::vector<DataHolder> holders, DataHolders(tx));
  while (used + bytes > limit) {
    const auto least = LeastInformative(&holders);
    if (least == holders.end()) {
      return absl::ResourceExhaustedError(fmt::format(
          "rig {} holds {} of at most {} bytes of data, all of it waiting for "
          "its score or in use by a run, and this segment has {}: try again "
          "later, or raise max-payload-bytes-per-rig",
          tx->rig(),
          used,
          limit,
          bytes));
    }
    SELFCAL_RETURN_IF_ERROR(Evict(tx, *least, quotas));
    used -= least->bytes;
    holders.erase(least);
  }
  return absl::OkStatus();
}

absl::StatusOr<bool> MakeRoomForReported(UnitOfWork* tx,
                                         std::int64_t bytes,
                                         const Quotas& quotas) {
  const std::int64_t limit = quotas.max_payload_bytes_per_rig;
  if (limit == 0) return true;
  SELFCAL_ASSIGN_OR_RETURN(std::int64_t used, DataBytes(tx));
  if (used + bytes <= limit) return true;
  SELFCAL_ASSIGN_OR_RETURN(std::vector<DataHolder> holders, DataHolders(tx));
  while (used + bytes > limit) {
    const auto least = LeastInformative(&holders);
    if (least == holders.end()) return false;
    SELFCAL_RETURN_IF_ERROR(DeleteData(tx, least->segment.sequence));
    used -= least->bytes;
    holders.erase(least);
  }
  return true;
}

absl::Status DropOldSegments(UnitOfWork* tx, const Quotas& quotas) {
  constexpr std::int64_t kSecond = 1'000'000'000;
  const std::int64_t most = quotas.max_segments_per_rig;
  if (most == 0 && quotas.max_segment_age_s == 0) return absl::OkStatus();
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t newest, NewestSequence(tx));
  const std::int64_t at_once =
      std::clamp<std::int64_t>(most / 10, 1, kMostAtOnce);
  const bool count = most > 0 && newest > most && newest % at_once == 0;
  if (!count && quotas.max_segment_age_s == 0) return absl::OkStatus();
  SELFCAL_ASSIGN_OR_RETURN(const std::vector<SegmentRow> unreferenced,
                           UnreferencedSegments(tx, kMaxDropped));
  int dropped = 0;
  for (const SegmentRow& segment : unreferenced) {
    // The newest stays whatever its age: the next sequence continues from it.
    if (segment.sequence == newest) continue;
    const bool too_many = count && segment.sequence <= newest - most;
    const std::int64_t age_ns = tx->now().steady_ns - segment.receive_steady_ns;
    const bool too_old = quotas.max_segment_age_s > 0 &&
                         !tx->now().keeps_aged &&
                         age_ns > quotas.max_segment_age_s * kSecond;
    if (!too_many && !too_old) continue;
    SELFCAL_RETURN_IF_ERROR(DeleteSegment(tx, segment.sequence));
    ++dropped;
  }
  if (dropped == 0) return absl::OkStatus();
  return AppendEvent(
      tx,
      EventKind::kDataEvicted,
      fmt::format("metadata of {} segments that nothing refers to was dropped: "
                  "older or more than the rig keeps",
                  dropped));
}

}  // namespace selfcal::server
