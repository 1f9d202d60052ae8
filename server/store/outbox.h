// The records that a device has still to report to its hub. A transaction that
// changes records of a rig (UnitOfWork::Changed) notes which, in the outbox; a
// report has them as they are when it is made, however often they changed, and
// its confirmation removes those that have not changed since. So the outbox is
// small, nothing is reported that was not committed, and a report that is lost
// or comes twice does no harm.
//
// The reports of a rig are numbered from 1. Number 1 begins anew: all records
// follow. A report that was not acknowledged is made again with the records as
// they are by then; its attempts are counted, over all numbers, so that the hub
// ignores an attempt older than the newest it has accepted.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "server/store/unit_of_work.h"

namespace selfcal::server {

// The data of segments that is reported. The numbers are stored.
enum class ReportedData {
  kNone = 0,
  kKept = 1,  // what is still there when its turn comes
  kAll = 2,   // it stays until it was reported
};

// A rig that is reported.
struct ReportedRig {
  std::string rig;
  std::int64_t key = 0;      // of the rig in the database
  std::int64_t report = 0;   // number of the last that was acknowledged
  std::int64_t time_ns = 0;  // when; 0: none so far
  bool deleted = false;      // only that, and its events, are left to report
  std::int64_t waiting = 0;  // records in the outbox
};

struct Report {
  std::string rig;
  std::int64_t key = 0;
  std::int64_t number = 0;
  std::int64_t attempt = 0;
  bool deleted = false;  // the rig; the records are its last events
  // selfcal.store.ReportedRecords, serialised; empty: there are none.
  std::string records;
  std::int64_t waiting = 0;  // records that are left for later reports
  // Of the records in the outbox, for the confirmation.
  struct Entry {
    std::int64_t place = 0;
    std::int64_t revision = 0;
  };
  std::vector<Entry> entries;
};

// Any thread may call; only one reports. Errors as for Store.
class Outbox {
 public:
  virtual ~Outbox() = default;

  // Rigs that are not reported yet.
  virtual absl::StatusOr<std::vector<std::string>> ListUnreported() = 0;
  // Reported rigs, deleted ones first.
  virtual absl::StatusOr<std::vector<ReportedRig>> List() = 0;
  // Puts all records of the rig into the outbox; the next report is number 1.
  virtual absl::Status BeginAnew(const std::string& rig, ReportedData data) = 0;
  // Writes which data is reported from now on, of all rigs that are.
  virtual absl::Status SetData(ReportedData data) = 0;
  // The next report, as a new attempt, with the first records of the outbox:
  // those that come to about `max_bytes`, but at least one.
  virtual absl::StatusOr<Report> Next(const ReportedRig& rig,
                                      std::int64_t max_bytes) = 0;
  // Has the next attempts to report the rig follow this one, which the hub
  // knows and this database, restored from a backup, does not.
  virtual absl::Status FollowAttempt(const ReportedRig& rig,
                                     std::int64_t attempt) = 0;
  // Removes what the hub has taken, at this time.
  virtual absl::Status Confirm(const Report& report, std::int64_t time_ns) = 0;
  // Reports no rig any more: what changes from now on is not noted.
  virtual absl::Status Close() = 0;
};

class Database;  // driver/driver.h

// `database` must outlive it.
std::unique_ptr<Outbox> MakeOutbox(Database* database);

// --- Within a unit of work.

// Notes what the unit of work has changed, if its rig is reported. Called
// before it is committed.
absl::Status NoteChanges(UnitOfWork* tx);

// Which data of the rig is reported; kNone if the rig is not.
absl::StatusOr<ReportedData> ReportedDataOf(UnitOfWork* tx);

// The data of segments that waits in the outbox.
struct WaitingData {
  std::int64_t segments = 0;
  std::int64_t bytes = 0;  // compressed
};
absl::StatusOr<WaitingData> DataInOutbox(UnitOfWork* tx);
// Removes the data of the oldest segment from the outbox, so that it is not
// reported. Returns its sequence, or 0 if there was none.
absl::StatusOr<std::int64_t> DropOldestData(UnitOfWork* tx);

}  // namespace selfcal::server
