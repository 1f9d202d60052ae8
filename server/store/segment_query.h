// State of a segment; filter and order of a list of segments.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "server/store/exclusion_cause.h"
#include "server/store/range.h"

namespace selfcal::server {

// kUnusable: its data is damaged or cannot be scored, or it is quarantined
// (server/domain/quarantine.h). Its problem says why; its information is not
// used any more. The numbers are those on disk and never change.
enum class SegmentState { kStored = 1, kScored = 2, kUnusable = 3 };

struct SegmentProperties {
  std::optional<SegmentState> state;
  std::optional<std::string> session;
  std::optional<bool> has_data;
  std::optional<std::string> in_table;     // the group of the table
  std::optional<ExclusionCause> excluded;  // from some table, for this cause

  friend bool operator==(const SegmentProperties&,
                         const SegmentProperties&) = default;
};

struct SegmentRanges {
  Range<std::int64_t> receive_time_ns;  // since the Unix epoch
  Range<std::int64_t> calibration_version;
  Range<std::int64_t> landmarks;
  Range<std::int64_t> observations;
  Range<double> temperature_c;
  Range<double> angular_rate_radps;
  Range<double> acceleration_mps2;

  friend bool operator==(const SegmentRanges&, const SegmentRanges&) = default;
};

struct ScoreRanges {
  // The group whose scores are filtered; empty for no filter.
  std::string scored_group;
  Range<double> entropy_nats;
  Range<double> gain_nats;

  friend bool operator==(const ScoreRanges&, const ScoreRanges&) = default;
};

struct SegmentOrder {
  enum class Order {
    kArrival,
    kLandmarks,
    kObservations,
    kTemperature,
    kAngularRate,
    kAcceleration,
    kEntropy,  // of order_group
    kGain,     // of order_group
  };
  Order order = Order::kArrival;
  std::string order_group;
  bool descending = true;  // otherwise the smallest comes first

  friend bool operator==(const SegmentOrder&, const SegmentOrder&) = default;
};

// A segment without a quantity, because it has no score or no temperature or is
// from before its motion was stored, is in no range of that quantity and in no
// list sorted by it.
struct SegmentQuery : SegmentProperties,
                      SegmentRanges,
                      ScoreRanges,
                      SegmentOrder {
  friend bool operator==(const SegmentQuery&, const SegmentQuery&) = default;
};

}  // namespace selfcal::server
