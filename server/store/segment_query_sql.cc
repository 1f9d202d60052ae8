#include "server/store/segment_query_sql.h"

#include <fmt/format.h>

#include <charconv>
#include <limits>
#include <string_view>

#include "server/status/status_macros.h"
#include "server/store/paging.h"

namespace selfcal::server {
namespace {

// A cast states the type of a parameter that may be NULL.
constexpr char kConditions[] =
    "WHERE s.rig = ?1 "
    "AND (CAST(?2 AS BIGINT) IS NULL OR s.state = ?2) "
    "AND (CAST(?3 AS TEXT) IS NULL OR s.session = ?3) "
    "AND (CAST(?4 AS BOOLEAN) IS NULL OR ?4 = EXISTS ("
    "  SELECT 1 FROM payloads p "
    "  WHERE p.rig = ?1 AND p.sequence = s.sequence)) "
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
    "AND CAST(?21 AS TEXT) IS NOT NULL "
    "AND CAST(?22 AS DOUBLE PRECISION) IS NOT NULL ";

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

// The inner query finds the rows of the page, the outer one reads their
// content.
std::string Sql(const std::string& columns, const SegmentQuery& query) {
  const bool by_arrival = query.order == SegmentQuery::Order::kArrival;
  const std::string_view way = query.descending ? "DESC" : "ASC";
  const std::string_view beyond = query.descending ? "<" : ">";
  const std::string_view key = KeyColumn(query.order);
  return fmt::format(
      "SELECT {}, page.key FROM (SELECT s.rig, s.sequence, {} AS key "
      "FROM segments s {} {} AND {} ORDER BY {} {} LIMIT ?24) page "
      "JOIN segments s USING (rig, sequence) "
      "LEFT JOIN segment_information i USING (rig, sequence) "
      "ORDER BY page.key {}, s.sequence {}",
      columns,
      key,
      IsOfGroup(query.order) ? "JOIN segment_scores o "
                               "ON o.rig = s.rig AND o.sequence = s.sequence "
                               "AND o.group_name = ?21"
                             : "",
      kConditions,
      by_arrival ? fmt::format("s.sequence {} ?23", beyond)
                 : fmt::format("(CAST({} AS DOUBLE PRECISION), s.sequence) {} "
                               "(?22, ?23)",
                               key,
                               beyond),
      by_arrival ? "s.sequence" : fmt::format("{} {}, s.sequence", key, way),
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

std::string ListName(const std::string& rig, const SegmentQuery& query) {
  std::string name = "segments/" + rig;
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

absl::StatusOr<SegmentPlace> PlaceOfPage(const std::string& list,
                                         const SegmentQuery& query,
                                         const Page& page) {
  SELFCAL_ASSIGN_OR_RETURN(const auto text, PageKey(list, page));
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  if (!text) {
    return query.descending ? SegmentPlace{kInfinity, INT64_MAX}
                            : SegmentPlace{-kInfinity, -1};
  }
  SegmentPlace place;
  const char* const end = text->data() + text->size();
  const auto key = std::from_chars(text->data(), end, place.key);
  if (key.ec == std::errc() && key.ptr != end && *key.ptr == ' ') {
    const auto sequence = std::from_chars(key.ptr + 1, end, place.sequence);
    if (sequence.ec == std::errc() && sequence.ptr == end) return place;
  }
  return BadPageToken();
}

std::string TokenAfter(const std::string& list, const SegmentPlace& place) {
  return MakePageToken(list, fmt::format("{} {}", place.key, place.sequence));
}

Statement SelectSegments(Connection* db,
                         const std::string& columns,
                         std::int64_t rig,
                         const SegmentQuery& query,
                         const SegmentPlace& after,
                         int limit) {
  return Statement(db,
                   Sql(columns, query),
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
                   limit);
}

}  // namespace selfcal::server
