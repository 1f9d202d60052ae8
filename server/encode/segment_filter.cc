#include "server/encode/segment_filter.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <string>
#include <vector>

#include "proto/safe_text.h"
#include "selfcal/v1/segment.pb.h"
#include "server/encode/filter_terms.h"
#include "server/encode/filter_values.h"
#include "server/status/status_macros.h"
#include "server/store/store.h"

namespace selfcal::server {
namespace {

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
  SELFCAL_RETURN_IF_ERROR(CheckEquality(term));
  if (term.field == "state") {
    return ReadWord(term,
                    "a state",
                    {{"STORED", SegmentState::kStored},
                     {"SCORED", SegmentState::kScored},
                     {"UNUSABLE", SegmentState::kUnusable}},
                    &query->state);
  }
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
