// Which segments of a rig a list shows, and in which order.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

namespace selfcal::server {

enum class SegmentState;

// Both ends belong to it; nothing: no end.
template <typename T>
struct Range {
  std::optional<T> least;
  std::optional<T> most;

  friend bool operator==(const Range&, const Range&) = default;
};

// A segment of which a quantity is not known, because it has no score or no
// temperature, is in no range of it and in no list that is sorted by it.
struct SegmentQuery {
  std::optional<SegmentState> state;
  std::optional<std::string> session;
  std::optional<bool> has_data;
  std::optional<std::string> in_table;  // the group of the table
  Range<std::int64_t> receive_time_ns;  // since the Unix epoch
  Range<std::int64_t> calibration_version;
  Range<std::int64_t> landmarks;
  Range<std::int64_t> observations;
  Range<double> temperature_c;
  // Of one group; empty: of none.
  std::string scored_group;
  Range<double> entropy_nats;
  Range<double> gain_nats;

  enum class Order {
    kArrival,
    kLandmarks,
    kObservations,
    kTemperature,
    kEntropy,  // of order_group
    kGain,     // of order_group
  };
  Order order = Order::kArrival;
  std::string order_group;
  bool descending = true;  // else what has least of it comes first

  friend bool operator==(const SegmentQuery&, const SegmentQuery&) = default;
};

}  // namespace selfcal::server
