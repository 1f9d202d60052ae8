// Settings of the rules.
#pragma once

#include <cstdint>

#include "core/change/detect_change.h"

namespace selfcal::server {

// Limits on what is kept; 0: no limit. Whatever they remove is recorded in an
// event.
struct Quotas {
  // Compressed data of one rig's segments. To make room for a new one, the data
  // of the least informative segments is evicted, which then leave the tables;
  // never that of a segment that waits for its score or that an unfinished run
  // needs.
  std::int64_t max_payload_bytes_per_rig = 0;
  // Segments of one rig whose metadata and information are kept, the newest
  // ones; a segment that waits for its score, is in a table, or was used by a
  // run or a calibration is never removed.
  std::int64_t max_segments_per_rig = 100'000;
  std::int64_t max_segment_age_s = 0;  // the same, by age
  // Size of the whole database. Near the limit new segments are refused, so
  // that those stored can still be scored.
  std::int64_t max_database_bytes = 0;
  // Bytes that stay free on the file system of the database, or a twentieth of
  // it if that is less. New segments are refused where they would not.
  std::int64_t min_free_bytes = std::int64_t{256} << 20;
  std::int64_t max_rigs = 10'000;
  // Compressed data of one rig's segments that is kept only until it is
  // reported to the hub. Beyond it, the oldest is not reported.
  std::int64_t max_unreported_bytes_per_rig = std::int64_t{1} << 30;

  friend bool operator==(const Quotas&, const Quotas&) = default;
};

struct DomainOptions {
  ChangeOptions change = {};  // how device changes are detected
  Quotas quotas = {};

  friend bool operator==(const DomainOptions&, const DomainOptions&) = default;
};

}  // namespace selfcal::server
