#include "server/encode/segment_filter.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <google/protobuf/util/time_util.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "proto/safe_text.h"
#include "selfcal/v1/segment.pb.h"
#include "server/encode/filter_terms.h"
#include "server/status/status_macros.h"
#include "server/store/store.h"

namespace selfcal::server {
namespace {

std::int64_t Next(std::int64_t value) { return value + (value != INT64_MAX); }
std::int64_t Before(std::int64_t value) { return value - (value != INT64_MIN); }
double Next(double value) {
  return std::nextafter(value, std::numeric_limits<double>::infinity());
}
double Before(double value) {
  return std::nextafter(value, -std::numeric_limits<double>::infinity());
}

// Narrows the range by a condition; several conditions on a field all apply.
template <typename T>
void Narrow(const std::string& sign, T value, Range<T>* range) {
  if (sign != "<" && sign != "<=") {
    const T least = sign == ">" ? Next(value) : value;
    range->least = std::max(range->least.value_or(least), least);
  }
  if (sign != ">" && sign != ">=") {
    const T most = sign == "<" ? Before(value) : value;
    range->most = std::min(range->most.value_or(most), most);
  }
}

template <typename T>
absl::Status NarrowByNumber(const FilterTerm& term, Range<T>* range) {
  T value = 0;
  const char* const end = term.value.data() + term.value.size();
  const auto parsed = std::from_chars(term.value.data(), end, value);
  const bool finite = std::isfinite(static_cast<double>(value));
  if (parsed.ec != std::errc() || parsed.ptr != end || !finite) {
    return NotWhatIsExpected(
        term.value, std::is_integral_v<T> ? "a whole number" : "a number");
  }
  Narrow(term.sign, value, range);
  return absl::OkStatus();
}

absl::Status NarrowByTime(const FilterTerm& term, Range<std::int64_t>* range) {
  google::protobuf::Timestamp time;
  if (!google::protobuf::util::TimeUtil::FromString(term.value, &time)) {
    return NotWhatIsExpected(term.value, "a time as 2026-11-21T04:10:03Z");
  }
  // Times in other years do not fit into 64 bits.
  if (time.seconds() < 0 || time.seconds() > INT64_MAX / 1'000'000'000 - 1) {
    return NotWhatIsExpected(term.value, "a time from 1970 to 2262");
  }
  Narrow(term.sign,
         google::protobuf::util::TimeUtil::TimestampToNanoseconds(time),
         range);
  return absl::OkStatus();
}

absl::Status NarrowByScore(const FilterTerm& term, SegmentQuery* query) {
  if (term.group.empty()) {
    return NotWhatIsExpected(
        term.field,
        fmt::format("a field: name the group, as {}.camera", term.field));
  }
  if (!query->scored_group.empty() && query->scored_group != term.group) {
    return absl::InvalidArgumentError(
        fmt::format("conditions on the scores of two groups, {} and {}: use "
                    "one group in a filter",
                    SafeLine(query->scored_group, kMaxTermShown),
                    SafeLine(term.group, kMaxTermShown)));
  }
  query->scored_group = term.group;
  return NarrowByNumber(
      term, term.field == "gain" ? &query->gain_nats : &query->entropy_nats);
}

absl::Status ReadState(const FilterTerm& term,
                       std::optional<SegmentState>* state) {
  if (term.value == "STORED") {
    *state = SegmentState::kStored;
  } else if (term.value == "SCORED") {
    *state = SegmentState::kScored;
  } else if (term.value == "UNUSABLE") {
    *state = SegmentState::kUnusable;
  } else {
    return NotWhatIsExpected(term.value, "a state: STORED, SCORED or UNUSABLE");
  }
  return absl::OkStatus();
}

absl::Status ReadBool(const FilterTerm& term, std::optional<bool>* value) {
  if (term.value != "true" && term.value != "false") {
    return NotWhatIsExpected(term.value, "true or false");
  }
  *value = term.value == "true";
  return absl::OkStatus();
}

absl::Status ReadCause(const FilterTerm& term,
                       std::optional<ExclusionCause>* cause) {
  using v1::TableExclusion;
  constexpr int kFirst = TableExclusion::CAUSE_UNSPECIFIED + 1;
  TableExclusion::Cause read = TableExclusion::CAUSE_UNSPECIFIED;
  if (!TableExclusion::Cause_Parse(term.value, &read) || read < kFirst) {
    std::vector<std::string> names;
    for (int k = kFirst; k < TableExclusion::Cause_ARRAYSIZE; ++k) {
      names.push_back(TableExclusion::Cause_Name(k));
    }
    return NotWhatIsExpected(
        term.value, fmt::format("a cause: {}", fmt::join(names, ", ")));
  }
  // The numbers of the contract are those of the store.
  *cause = static_cast<ExclusionCause>(read);
  return absl::OkStatus();
}

// Applies a condition on a field that supports only '='.
absl::Status ApplyEquality(const FilterTerm& term, SegmentQuery* query) {
  if (term.sign != "=") {
    return NotWhatIsExpected(term.sign,
                             fmt::format("= : {} has no order", term.field));
  }
  if (term.field == "state") return ReadState(term, &query->state);
  if (term.field == "has_data") return ReadBool(term, &query->has_data);
  if (term.field == "excluded") return ReadCause(term, &query->excluded);
  if (term.field == "session") {
    query->session = term.value;
  } else {
    query->in_table = term.value;
  }
  return absl::OkStatus();
}

absl::Status Apply(const FilterTerm& term, SegmentQuery* query) {
  if (term.field == "entropy" || term.field == "gain") {
    return NarrowByScore(term, query);
  }
  if (term.group.empty()) {
    for (const char* const field :
         {"state", "session", "has_data", "in_table", "excluded"}) {
      if (term.field == field) return ApplyEquality(term, query);
    }
    if (term.field == "receive_time") {
      return NarrowByTime(term, &query->receive_time_ns);
    }
    if (term.field == "calibration_version") {
      return NarrowByNumber(term, &query->calibration_version);
    }
    if (term.field == "landmarks") {
      return NarrowByNumber(term, &query->landmarks);
    }
    if (term.field == "observations") {
      return NarrowByNumber(term, &query->observations);
    }
    if (term.field == "temperature_c") {
      return NarrowByNumber(term, &query->temperature_c);
    }
    if (term.field == "angular_rate") {
      return NarrowByNumber(term, &query->angular_rate_radps);
    }
    if (term.field == "acceleration") {
      return NarrowByNumber(term, &query->acceleration_mps2);
    }
  }
  return NotWhatIsExpected(
      term.field,
      "a field: state, session, has_data, in_table, excluded, receive_time, "
      "calibration_version, landmarks, observations, temperature_c, "
      "angular_rate, acceleration, entropy.GROUP or gain.GROUP");
}

}  // namespace

absl::Status ParseSegmentFilter(std::string_view filter, SegmentQuery* query) {
  return ForEachTerm(
      filter, LoneTexts::kRefused, [query](const FilterTerm& term) {
        return Apply(term, query);
      });
}

absl::Status ParseSegmentOrder(std::string_view order_by, SegmentQuery* query) {
  using Order = SegmentQuery::Order;
  if (order_by.empty()) return absl::OkStatus();
  SELFCAL_ASSIGN_OR_RETURN(const ListOrder order, ParseOrder(order_by, "desc"));
  const std::string& field = order.field;
  query->descending = order.descending;
  if (field == "receive_time") {
    query->order = Order::kArrival;
  } else if (field == "landmarks") {
    query->order = Order::kLandmarks;
  } else if (field == "observations") {
    query->order = Order::kObservations;
  } else if (field == "temperature_c") {
    query->order = Order::kTemperature;
  } else if (field == "angular_rate") {
    query->order = Order::kAngularRate;
  } else if (field == "acceleration") {
    query->order = Order::kAcceleration;
  } else if (field.starts_with("entropy.")) {
    query->order = Order::kEntropy;
  } else if (field.starts_with("gain.")) {
    query->order = Order::kGain;
  } else {
    return NotWhatIsExpected(
        field,
        "a field to sort by: receive_time, landmarks, observations, "
        "temperature_c, angular_rate, acceleration, entropy.GROUP or "
        "gain.GROUP");
  }
  const auto dot = field.find('.');
  if (dot != std::string::npos) query->order_group = field.substr(dot + 1);
  return absl::OkStatus();
}

}  // namespace selfcal::server
