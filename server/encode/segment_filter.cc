#include "server/encode/segment_filter.h"

#include <fmt/format.h>
#include <google/protobuf/util/time_util.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string>

#include "server/encode/shortened.h"
#include "server/store/status_macros.h"
#include "server/store/store.h"

namespace selfcal::server {
namespace {

constexpr std::size_t kMaxFilter = 4000;
constexpr std::size_t kMaxShown = 60;

absl::Status Wrong(std::string_view what, std::string_view expected) {
  return absl::InvalidArgumentError(
      fmt::format("'{}' is not {}", Shortened(what, kMaxShown), expected));
}

bool IsOfWord(char c) {
  return (c >= '0' && c <= '9') || (c >= 'A' && c <= 'Z') ||
         (c >= 'a' && c <= 'z') ||
         std::string_view("_-+.:~").find(c) != std::string_view::npos;
}

// A tokeniser: words, quoted texts and comparisons.
class Words {
 public:
  explicit Words(std::string_view text) : rest_(text) { SkipSpace(); }

  bool at_end() const { return rest_.empty(); }

  absl::StatusOr<std::string> Word(std::string_view expected) {
    if (!rest_.empty() && rest_.front() == '"') return Quoted();
    const auto end = std::find_if_not(rest_.begin(), rest_.end(), IsOfWord);
    std::string word(rest_.begin(), end);
    if (word.empty()) {
      return Wrong(rest_.empty() ? "the end" : rest_, expected);
    }
    rest_.remove_prefix(word.size());
    SkipSpace();
    return word;
  }

  absl::StatusOr<std::string> Comparison() {
    for (const std::string_view sign : {"<=", ">=", "<", ">", "="}) {
      if (!rest_.starts_with(sign)) continue;
      rest_.remove_prefix(sign.size());
      SkipSpace();
      return std::string(sign);
    }
    return Wrong(rest_.empty() ? "the end" : rest_, "one of = < <= > >=");
  }

 private:
  void SkipSpace() {
    rest_.remove_prefix(
        std::min(rest_.find_first_not_of(" \t\r\n"), rest_.size()));
  }

  absl::StatusOr<std::string> Quoted() {
    std::string text;
    for (std::size_t k = 1; k < rest_.size(); ++k) {
      if (rest_[k] == '"') {
        rest_.remove_prefix(k + 1);
        SkipSpace();
        return text;
      }
      if (rest_[k] == '\\' && k + 1 < rest_.size()) ++k;
      text += rest_[k];
    }
    return Wrong(rest_, "closed by a quote");
  }

  std::string_view rest_;
};

struct Term {
  std::string field;
  std::string group;  // after the dot of the field, if there is one
  std::string sign;
  std::string value;
};

absl::StatusOr<Term> NextTerm(Words* words) {
  Term term;
  SELFCAL_ASSIGN_OR_RETURN(term.field, words->Word("a field"));
  SELFCAL_ASSIGN_OR_RETURN(term.sign, words->Comparison());
  SELFCAL_ASSIGN_OR_RETURN(term.value, words->Word("a value"));
  const auto dot = term.field.find('.');
  if (dot != std::string::npos) {
    term.group = term.field.substr(dot + 1);
    term.field.resize(dot);
  }
  return term;
}

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
absl::Status NarrowByNumber(const Term& term, Range<T>* range) {
  T value = 0;
  const char* const end = term.value.data() + term.value.size();
  const auto parsed = std::from_chars(term.value.data(), end, value);
  const bool finite = std::isfinite(static_cast<double>(value));
  if (parsed.ec != std::errc() || parsed.ptr != end || !finite) {
    return Wrong(term.value,
                 std::is_integral_v<T> ? "a whole number" : "a number");
  }
  Narrow(term.sign, value, range);
  return absl::OkStatus();
}

absl::Status NarrowByTime(const Term& term, Range<std::int64_t>* range) {
  google::protobuf::Timestamp time;
  if (!google::protobuf::util::TimeUtil::FromString(term.value, &time)) {
    return Wrong(term.value, "a time as 2026-11-21T04:10:03Z");
  }
  // Times in other years do not fit into 64 bits.
  if (time.seconds() < 0 || time.seconds() > INT64_MAX / 1'000'000'000 - 1) {
    return Wrong(term.value, "a time from 1970 to 2262");
  }
  Narrow(term.sign,
         google::protobuf::util::TimeUtil::TimestampToNanoseconds(time),
         range);
  return absl::OkStatus();
}

absl::Status NarrowByScore(const Term& term, SegmentQuery* query) {
  if (term.group.empty()) {
    return Wrong(
        term.field,
        fmt::format("a field: name the group, as {}.camera", term.field));
  }
  if (!query->scored_group.empty() && query->scored_group != term.group) {
    return absl::InvalidArgumentError(
        fmt::format("conditions on the scores of two groups, {} and {}: use "
                    "one group in a filter",
                    Shortened(query->scored_group, kMaxShown),
                    Shortened(term.group, kMaxShown)));
  }
  query->scored_group = term.group;
  return NarrowByNumber(
      term, term.field == "gain" ? &query->gain_nats : &query->entropy_nats);
}

absl::Status ReadState(const Term& term, std::optional<SegmentState>* state) {
  if (term.value == "STORED") {
    *state = SegmentState::kStored;
  } else if (term.value == "SCORED") {
    *state = SegmentState::kScored;
  } else if (term.value == "UNUSABLE") {
    *state = SegmentState::kUnusable;
  } else {
    return Wrong(term.value, "a state: STORED, SCORED or UNUSABLE");
  }
  return absl::OkStatus();
}

absl::Status ReadBool(const Term& term, std::optional<bool>* value) {
  if (term.value != "true" && term.value != "false") {
    return Wrong(term.value, "true or false");
  }
  *value = term.value == "true";
  return absl::OkStatus();
}

// Applies a condition on a field that supports only '='.
absl::Status ApplyEquality(const Term& term, SegmentQuery* query) {
  if (term.sign != "=") {
    return Wrong(term.sign, fmt::format("= : {} has no order", term.field));
  }
  if (term.field == "state") return ReadState(term, &query->state);
  if (term.field == "has_data") return ReadBool(term, &query->has_data);
  if (term.field == "session") {
    query->session = term.value;
  } else {
    query->in_table = term.value;
  }
  return absl::OkStatus();
}

absl::Status Apply(const Term& term, SegmentQuery* query) {
  if (term.field == "entropy" || term.field == "gain") {
    return NarrowByScore(term, query);
  }
  if (term.group.empty()) {
    for (const char* const field :
         {"state", "session", "has_data", "in_table"}) {
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
  }
  return Wrong(term.field,
               "a field: state, session, has_data, in_table, receive_time, "
               "calibration_version, landmarks, observations, temperature_c, "
               "entropy.GROUP or gain.GROUP");
}

}  // namespace

absl::Status ParseSegmentFilter(std::string_view filter, SegmentQuery* query) {
  if (filter.size() > kMaxFilter) {
    return absl::InvalidArgumentError(
        fmt::format("is longer than {} characters", kMaxFilter));
  }
  Words words(filter);
  while (!words.at_end()) {
    SELFCAL_ASSIGN_OR_RETURN(const Term term, NextTerm(&words));
    SELFCAL_RETURN_IF_ERROR(Apply(term, query));
    if (words.at_end()) break;
    SELFCAL_ASSIGN_OR_RETURN(const std::string joint, words.Word("AND"));
    if (joint != "AND") return Wrong(joint, "AND between two conditions");
    if (words.at_end()) return Wrong("the end", "a condition");
  }
  return absl::OkStatus();
}

absl::Status ParseSegmentOrder(std::string_view order_by, SegmentQuery* query) {
  using Order = SegmentQuery::Order;
  Words words(order_by);
  if (words.at_end()) return absl::OkStatus();
  SELFCAL_ASSIGN_OR_RETURN(const std::string field, words.Word("a field"));
  std::string way = "desc";
  if (!words.at_end()) {
    SELFCAL_ASSIGN_OR_RETURN(way, words.Word("asc or desc"));
  }
  if ((way != "asc" && way != "desc") || !words.at_end()) {
    return Wrong(order_by, "one field, then asc or desc");
  }
  query->descending = way == "desc";
  if (field == "receive_time") {
    query->order = Order::kArrival;
  } else if (field == "landmarks") {
    query->order = Order::kLandmarks;
  } else if (field == "observations") {
    query->order = Order::kObservations;
  } else if (field == "temperature_c") {
    query->order = Order::kTemperature;
  } else if (field.starts_with("entropy.")) {
    query->order = Order::kEntropy;
  } else if (field.starts_with("gain.")) {
    query->order = Order::kGain;
  } else {
    return Wrong(field,
                 "a field to sort by: receive_time, landmarks, observations, "
                 "temperature_c, entropy.GROUP or gain.GROUP");
  }
  const auto dot = field.find('.');
  if (dot != std::string::npos) query->order_group = field.substr(dot + 1);
  return absl::OkStatus();
}

}  // namespace selfcal::server
