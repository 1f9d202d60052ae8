#include "server/store/segment_query_sql.h"

#include <absl/strings/numbers.h>
#include <absl/strings/str_split.h>
#include <fmt/format.h>

#include <limits>
#include <string_view>
#include <vector>

#include "server/status/status_macros.h"
#include "server/store/paging.h"
#include "server/store/rig_lists.h"

namespace selfcal::server {
namespace {

// A cast states the type of a parameter that may be NULL.
constexpr char kConditions[] =
    "WHERE (CAST(?2 AS BIGINT) IS NULL OR s.state = ?2) "
    "AND (CAST(?3 AS TEXT) IS NULL OR s.session = ?3) "
    "AND (CAST(?4 AS BOOLEAN) IS NULL OR ?4 = EXISTS ("
    "  SELECT 1 FROM payloads p "
    "  WHERE p.rig = s.rig AND p.sequence = s.sequence)) "
    "AND (CAST(?5 AS TEXT) IS NULL OR EXISTS (SELECT 1 FROM table_entries e "
    "  WHERE e.rig = s.rig AND e.group_name = ?5 "
    "  AND e.sequence = s.sequence)) "
    "AND (CAST(?6 AS BIGINT) IS NULL OR s.receive_time_ns >= ?6) "
    "AND (CAST(?7 AS BIGINT) IS NULL OR s.receive_time_ns <= ?7) "
    "AND (CAST(?8 AS BIGINT) IS NULL OR s.calibration_version >= ?8) "
    "AND (CAST(?9 AS BIGINT) IS NULL OR s.calibration_version <= ?9) "
    "AND (CAST(?10 AS BIGINT) IS NULL OR s.landmarks >= ?10) "
    "AND (CAST(?11 AS BIGINT) IS NULL OR s.landmarks <= ?11) "
    "AND (CAST(?12 AS BIGINT) IS NULL OR s.observations >= ?12) "
    "AND (CAST(?13 AS BIGINT) IS NULL OR s.observations <= ?13) "
    "AND (CAST(?14 AS DOUBLE PRECISION) IS NULL OR s.temperature_c >= ?14) "
    "AND (CAST(?15 AS DOUBLE PRECISION) IS NULL OR s.temperature_c <= ?15) "
    "AND (?16 = '' OR EXISTS (SELECT 1 FROM segment_scores c "
    "  WHERE c.rig = s.rig AND c.sequence = s.sequence "
    "  AND c.group_name = ?16 "
    "  AND (CAST(?17 AS DOUBLE PRECISION) IS NULL OR c.entropy >= ?17) "
    "  AND (CAST(?18 AS DOUBLE PRECISION) IS NULL OR c.entropy <= ?18) "
    "  AND (CAST(?19 AS DOUBLE PRECISION) IS NULL OR c.gain >= ?19) "
    "  AND (CAST(?20 AS DOUBLE PRECISION) IS NULL OR c.gain <= ?20))) "
    // Not every order uses these, but every parameter is used.
    "AND CAST(?1 AS BIGINT) IS NOT NULL "
    "AND CAST(?21 AS TEXT) IS NOT NULL "
    "AND CAST(?22 AS DOUBLE PRECISION) IS NOT NULL "
    "AND CAST(?25 AS BIGINT) IS NOT NULL "
    "AND CAST(?26 AS BIGINT) IS NOT NULL ";

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

// The rows of a list in their order: what comes after a position, and what they
// are sorted by.
struct OrderSql {
  std::string key;
  std::string after;
  std::string order_by;
};

OrderSql OrderOfRig(const SegmentQuery& query) {
  const std::string_view way = query.descending ? "DESC" : "ASC";
  const std::string_view beyond = query.descending ? "<" : ">";
  const std::string key(KeyColumn(query.order));
  if (query.order == SegmentQuery::Order::kArrival) {
    return {key,
            fmt::format("s.rig = ?1 AND s.sequence {} ?23", beyond),
            fmt::format("s.sequence {}", way)};
  }
  return {key,
          fmt::format("s.rig = ?1 AND "
                      "(CAST({} AS DOUBLE PRECISION), s.sequence) {} "
                      "(?22, ?23)",
                      key,
                      beyond),
          fmt::format("{} {}, s.sequence {}", key, way, way)};
}

OrderSql OrderOfAll(const SegmentQuery& query) {
  const std::string_view way = query.descending ? "DESC" : "ASC";
  const std::string_view beyond = query.descending ? "<" : ">";
  if (query.order == SegmentQuery::Order::kArrival) {
    return {"s.steady_ns",
            fmt::format("(s.steady_ns, s.rig, s.sequence) {} (?26, ?25, ?23)",
                        beyond),
            fmt::format("s.steady_ns {0}, s.rig {0}, s.sequence {0}", way)};
  }
  return {"o.gain",
          fmt::format("(o.gain, o.rig, o.sequence) {} (?22, ?25, ?23)", beyond),
          fmt::format("o.gain {0}, o.rig {0}, o.sequence {0}", way)};
}

// The inner query finds the rows of the page, the outer one reads their
// content.
std::string Sql(const std::string& columns,
                const SegmentQuery& query,
                bool of_all,
                const RigCondition& condition) {
  const OrderSql order = of_all ? OrderOfAll(query) : OrderOfRig(query);
  const std::string_view way = query.descending ? "DESC" : "ASC";
  const bool some = of_all && !condition.is_every_rig();
  return fmt::format(
      "SELECT {}, page.key FROM (SELECT s.rig, s.sequence, {} AS key "
      "FROM segments s {} {} {} AND {} {} ORDER BY {} LIMIT ?24) page "
      "JOIN segments s USING (rig, sequence) "
      "LEFT JOIN segment_information i USING (rig, sequence) "
      "ORDER BY page.key {}, s.rig {}, s.sequence {}",
      columns,
      order.key,
      IsOfGroup(query.order) ? "JOIN segment_scores o "
                               "ON o.rig = s.rig AND o.sequence = s.sequence "
                               "AND o.group_name = ?21"
                             : "",
      some ? "JOIN rigs r ON r.rig = s.rig" : "",
      kConditions,
      order.after,
      some ? "AND " + condition.sql() : "",
      order.order_by,
      way,
      way,
      way);
}

std::optional<int> StateNumber(const std::optional<SegmentState>& state) {
  if (!state) return std::nullopt;
  return static_cast<int>(*state) + 1;
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

Statement SelectSegments(Connection* db,
                         const std::string& columns,
                         std::int64_t rig,
                         const SegmentQuery& query,
                         const RigCondition& condition,
                         const SegmentPlace& after,
                         int limit) {
  return Statement(db,
                   Sql(columns, query, rig == 0, condition),
                   rig,
                   StateNumber(query.state),
                   query.session,
                   query.has_data,
                   query.in_table,
                   query.receive_time_ns.least,
                   query.receive_time_ns.most,
                   query.calibration_version.least,
                   query.calibration_version.most,
                   query.landmarks.least,
                   query.landmarks.most,
                   query.observations.least,
                   query.observations.most,
                   query.temperature_c.least,
                   query.temperature_c.most,
                   query.scored_group,
                   query.entropy_nats.least,
                   query.entropy_nats.most,
                   query.gain_nats.least,
                   query.gain_nats.most,
                   query.order_group,
                   after.key,
                   after.sequence,
                   limit,
                   after.rig,
                   after.steady_ns);
}

}  // namespace selfcal::server
