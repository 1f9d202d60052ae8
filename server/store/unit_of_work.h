// One transaction about one rig: a handle for the functions of this module that
// read and write records (rigs.h, segment_rows.h, table_rows.h, runs.h,
// calibrations.h, change_rows.h, events.h, ...). They hold no policy: what is
// written, and when, is decided by the caller.
//
// Store::Transact opens a unit of work that writes, Store::Inspect one that
// only reads. Not thread-safe; valid during the call that it is passed to.
#pragma once

#include <cstdint>
#include <set>
#include <string>
#include <utility>

#include "server/store/moment.h"
#include "server/store/record_kind.h"

namespace selfcal::server {

class Connection;  // driver/driver.h

class UnitOfWork {
 public:
  UnitOfWork(Connection* db,
             std::string rig,
             std::int64_t rig_row,
             const Moment& now)
      : db_(db), rig_(std::move(rig)), rig_row_(rig_row), now_(now) {}
  UnitOfWork(const UnitOfWork&) = delete;
  UnitOfWork& operator=(const UnitOfWork&) = delete;

  // Name of the rig, which exists.
  const std::string& rig() const { return rig_; }
  // The time of what is written.
  const Moment& now() const { return now_; }
  std::int64_t time_ns() const { return now_.time_ns; }

  // Notes that a record has changed, which a device reports to its hub
  // (outbox.h). Called by what writes the record.
  void Changed(RecordKind kind, std::int64_t number = 0) {
    changed_.emplace(kind, number);
  }
  // By kind and number.
  const std::set<std::pair<RecordKind, std::int64_t>>& changed() const {
    return changed_;
  }

  // For the statements of this module.
  Connection* db() const { return db_; }
  std::int64_t rig_row() const { return rig_row_; }

 private:
  Connection* db_;
  std::string rig_;
  std::int64_t rig_row_;
  Moment now_;
  std::set<std::pair<RecordKind, std::int64_t>> changed_;
};

}  // namespace selfcal::server
