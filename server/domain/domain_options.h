// What an operator sets of the rules.
#pragma once

#include <cstdint>

#include "core/change/detect_change.h"

namespace selfcal::server {

// Limits of what is kept; 0: none. Whatever they remove leaves an event.
struct Quotas {
  // Compressed data of one rig's segments. For a new one the data of the least
  // informative segments is evicted, which then leave the tables; never that of
  // a segment that waits for its score or that an unfinished run needs.
  std::int64_t max_payload_bytes_per_rig = 0;
  // Metadata and information of one rig's segments, the newest kept; never of
  // one that waits for its score, is in a table, or that a run or a calibration
  // used.
  std::int64_t max_segments_per_rig = 0;
  std::int64_t max_segment_age_s = 0;  // the same by the time of arrival
  // The whole database. Near it new segments are refused, so that what is
  // stored can still be scored.
  std::int64_t max_database_bytes = 0;
  std::int64_t max_rigs = 10'000;

  friend bool operator==(const Quotas&, const Quotas&) = default;
};

struct DomainOptions {
  ChangeOptions change = {};  // how device changes are detected
  Quotas quotas = {};

  friend bool operator==(const DomainOptions&, const DomainOptions&) = default;
};

}  // namespace selfcal::server
