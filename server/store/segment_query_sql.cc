#include "server/store/segment_query_sql.h"

#include <absl/strings/numbers.h>
#include <absl/strings/str_split.h>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <limits>
#include <string_view>
#include <vector>

#include "server/status/status_macros.h"
#include "server/store/paging.h"
#include "server/store/rig_lists.h"

namespace selfcal::server {
namespace {

template <typename T>
void AndRange(const std::string& column,
              const Range<T>& range,
              SqlCondition* to) {
  if (range.least) to->And(column + " >= " + to->Parameter(*range.least));
  if (range.most) to->And(column + " <= " + to->Parameter(*range.most));
}

void AndScores(const SegmentQuery& query, SqlCondition* to) {
  if (query.scored_group.empty()) return;
  SqlCondition scores = to->Next();
  scores.And("c.group_name = " + scores.Parameter(query.scored_group));
  AndRange("c.entropy", query.entropy_nats, &scores);
  AndRange("c.gain", query.gain_nats, &scores);
  to->AndWithin(
      "EXISTS (SELECT 1 FROM segment_scores c WHERE c.rig = s.rig "
      "  AND c.sequence = s.sequence AND ",
      scores,
      ")");
}

void AndFilter(const SegmentQuery& query, SqlCondition* to) {
  if (query.state) {
    to->And("s.state = " +
            to->Parameter(std::int64_t{static_cast<int>(*query.state)}));
  }
  if (query.session) {
    to->And("s.session = " + to->Parameter(*query.session));
  }
  if (query.has_data) {
    to->And(
        fmt::format("{} (SELECT 1 FROM payloads p WHERE p.rig = s.rig "
                    "  AND p.sequence = s.sequence)",
                    *query.has_data ? "EXISTS" : "NOT EXISTS"));
  }
  if (query.in_table) {
    to->And(
        "EXISTS (SELECT 1 FROM table_entries e WHERE e.rig = s.rig "
        "  AND e.sequence = s.sequence AND e.group_name = " +
        to->Parameter(*query.in_table) + ")");
  }
  AndRange("s.receive_time_ns", query.receive_time_ns, to);
  AndRange("s.calibration_version", query.calibration_version, to);
  AndRange("s.landmarks", query.landmarks, to);
  AndRange("s.observations", query.observations, to);
  AndRange("s.temperature_c", query.temperature_c, to);
  AndScores(query, to);
}

bool IsOfGroup(SegmentQuery::Order order) {
  return order == SegmentQuery::Order::kEntropy ||
         order == SegmentQuery::Order::kGain;
}

std::string_view KeyColumn(SegmentQuery::Order order) {
  switch (order) {
    case SegmentQuery::Order::kArrival:
      return "s.sequence";
    case SegmentQuery::Order::kLandmarks:
      return "s.landmarks";
    case SegmentQuery::Order::kObservations:
      return "s.observations";
    case SegmentQuery::Order::kTemperature:
      return "s.temperature_c";
    case SegmentQuery::Order::kEntropy:
      return "o.entropy";
    case SegmentQuery::Order::kGain:
      return "o.gain";
  }
  return "s.sequence";
}

// The columns that a list is sorted by; the first is the key. The index of the
// order has them all.
std::vector<std::string> OrderColumns(const SegmentQuery& query, bool of_all) {
  const bool by_arrival = query.order == SegmentQuery::Order::kArrival;
  const char* const table = IsOfGroup(query.order) ? "o" : "s";
  std::vector<std::string> columns;
  if (by_arrival && of_all) {
    columns.push_back("s.steady_ns");
  } else if (!by_arrival) {
    columns.emplace_back(KeyColumn(query.order));
  }
  if (of_all) columns.push_back(fmt::format("{}.rig", table));
  columns.push_back(fmt::format("{}.sequence", table));
  return columns;
}

// The values of these columns at the position, as parameters.
std::vector<std::string> OrderValues(const SegmentQuery& query,
                                     bool of_all,
                                     const SegmentPlace& after,
                                     SqlCondition* to) {
  const bool by_arrival = query.order == SegmentQuery::Order::kArrival;
  std::vector<std::string> values;
  if (by_arrival && of_all) {
    values.push_back(to->Parameter(after.steady_ns));
  } else if (!by_arrival) {
    // The column may be one of whole numbers, which has no infinity.
    values.push_back(
        fmt::format("CAST({} AS DOUBLE PRECISION)", to->Parameter(after.key)));
  }
  if (of_all) values.push_back(to->Parameter(after.rig));
  values.push_back(to->Parameter(after.sequence));
  return values;
}

std::optional<int> StateNumber(const std::optional<SegmentState>& state) {
  if (!state) return std::nullopt;
  return static_cast<int>(*state);
}

template <typename T>
std::string RangeText(const Range<T>& range) {
  return fmt::format("{}..{}",
                     range.least ? fmt::format("{}", *range.least) : "",
                     range.most ? fmt::format("{}", *range.most) : "");
}

}  // namespace

std::string ListName(const std::string& rig,
                     const SegmentQuery& query,
                     const RigQuery& rigs) {
  std::string name = "segments/" + rig;
  if (rig.empty()) name += FilterText(rigs);
  if (query == SegmentQuery()) return name;
  const auto text = [](const std::optional<std::string>& value) {
    return value ? fmt::format("={}:{}", value->size(), *value) : "";
  };
  return fmt::format("{}?{}/{}/{}/{}/{}/{}/{}/{}/{}/{}:{}/{}/{}/{}/{}:{}/{}",
                     name,
                     StateNumber(query.state).value_or(0),
                     text(query.session),
                     query.has_data ? (*query.has_data ? "yes" : "no") : "",
                     text(query.in_table),
                     RangeText(query.receive_time_ns),
                     RangeText(query.calibration_version),
                     RangeText(query.landmarks),
                     RangeText(query.observations),
                     RangeText(query.temperature_c),
                     query.scored_group.size(),
                     query.scored_group,
                     RangeText(query.entropy_nats),
                     RangeText(query.gain_nats),
                     static_cast<int>(query.order),
                     query.order_group.size(),
                     query.order_group,
                     query.descending);
}

absl::Status CheckOrderOfAll(const SegmentQuery& query) {
  if (query.order == SegmentQuery::Order::kArrival ||
      query.order == SegmentQuery::Order::kGain) {
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(
      "the segments of all rigs can be sorted by receive_time or gain.GROUP: "
      "name a rig to sort by this field");
}

absl::StatusOr<SegmentPlace> PlaceOfPage(const std::string& list,
                                         const SegmentQuery& query,
                                         const Page& page) {
  SELFCAL_ASSIGN_OR_RETURN(const auto text, PageKey(list, page));
  if (!text) {
    using Doubles = std::numeric_limits<double>;
    if (query.descending) {
      return SegmentPlace{Doubles::infinity(), INT64_MAX, INT64_MAX, INT64_MAX};
    }
    return SegmentPlace{-Doubles::infinity(), INT64_MIN, -1, -1};
  }
  SegmentPlace place;
  const std::vector<std::string> numbers = absl::StrSplit(*text, ' ');
  if (numbers.size() == 4 && absl::SimpleAtod(numbers[0], &place.key) &&
      absl::SimpleAtoi(numbers[1], &place.steady_ns) &&
      absl::SimpleAtoi(numbers[2], &place.rig) &&
      absl::SimpleAtoi(numbers[3], &place.sequence)) {
    return place;
  }
  return BadPageToken();
}

std::string TokenAfter(const std::string& list, const SegmentPlace& place) {
  return MakePageToken(list,
                       fmt::format("{} {} {} {}",
                                   place.key,
                                   place.steady_ns,
                                   place.rig,
                                   place.sequence));
}

// The inner query finds the rows of the page, the outer one reads their
// content.
std::string SelectSegments(const std::string& columns,
                           std::int64_t rig,
                           const SegmentQuery& query,
                           const RigQuery& rigs,
                           const SegmentPlace& after,
                           int limit,
                           SqlCondition* condition) {
  const bool of_all = rig == 0;
  const char* const table = IsOfGroup(query.order) ? "o" : "s";
  if (IsOfGroup(query.order)) {
    condition->And("o.group_name = " + condition->Parameter(query.order_group));
  }
  if (!of_all) {
    condition->And(
        fmt::format("{}.rig = {}", table, condition->Parameter(rig)));
  }
  AndFilter(query, condition);
  const auto order = OrderColumns(query, of_all);
  const auto values = OrderValues(query, of_all, after, condition);
  condition->And(fmt::format("({}) {} ({})",
                             fmt::join(order, ", "),
                             query.descending ? "<" : ">",
                             fmt::join(values, ", ")));
  SqlCondition of_rigs = condition->Next();
  if (of_all) AddRigConditions(rigs, "r", &of_rigs);
  const bool some_rigs = !of_rigs.is_empty();
  if (some_rigs) condition->And(of_rigs);
  const std::string_view way = query.descending ? "DESC" : "ASC";
  const std::string sorted =
      fmt::format("{} {}", fmt::join(order, fmt::format(" {}, ", way)), way);
  return fmt::format(
      "SELECT {}, page.key FROM (SELECT s.rig, s.sequence, {} AS key "
      "FROM segments s {} {} WHERE {} ORDER BY {} LIMIT {}) page "
      "JOIN segments s USING (rig, sequence) "
      "LEFT JOIN segment_information i USING (rig, sequence) "
      "ORDER BY page.key {}, s.rig {}, s.sequence {}",
      columns,
      order.front(),
      IsOfGroup(query.order)
          ? "JOIN segment_scores o ON o.rig = s.rig AND o.sequence = s.sequence"
          : "",
      some_rigs ? "JOIN rigs r ON r.rig = s.rig" : "",
      condition->sql(),
      sorted,
      limit,
      way,
      way,
      way);
}

}  // namespace selfcal::server
