#include "server/store/segment_query_sql.h"

#include <absl/strings/numbers.h>
#include <absl/strings/str_split.h>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <optional>
#include <string_view>
#include <vector>

#include "server/status/status_macros.h"
#include "server/store/exclusions.h"
#include "server/store/paging.h"
#include "server/store/query_conditions.h"
#include "server/store/rig_lists.h"

namespace selfcal::server {
namespace {

void AndProperties(const SegmentProperties& filter, SqlCondition* to) {
  // A literal, as the condition of a partial index has one.
  if (filter.state) {
    to->And(fmt::format("s.state = {}", static_cast<int>(*filter.state)));
  }
  if (filter.session) {
    to->And("s.session = " + to->Parameter(*filter.session));
  }
  if (filter.has_data) {
    to->And(
        fmt::format("{} (SELECT 1 FROM payloads p WHERE p.rig = s.rig "
                    "  AND p.sequence = s.sequence)",
                    *filter.has_data ? "EXISTS" : "NOT EXISTS"));
  }
  if (filter.in_table) {
    to->And(
        "EXISTS (SELECT 1 FROM table_entries e WHERE e.rig = s.rig "
        "  AND e.sequence = s.sequence AND e.group_name = " +
        to->Parameter(*filter.in_table) + ")");
  }
  if (filter.excluded) {
    to->And(
        ExcludedFor(to->Parameter(ExclusionCauses{*filter.excluded}.bits())));
  }
}

void AndRanges(const SegmentRanges& filter, SqlCondition* to) {
  AndRange("s.receive_time_ns", filter.receive_time_ns, to);
  AndRange("s.calibration_version", filter.calibration_version, to);
  AndRange("s.landmarks", filter.landmarks, to);
  AndRange("s.observations", filter.observations, to);
  AndRange("s.temperature_c", filter.temperature_c, to);
  AndRange("s.angular_rate", filter.angular_rate_radps, to);
  AndRange("s.acceleration", filter.acceleration_mps2, to);
}

void AndScores(const ScoreRanges& filter, SqlCondition* to) {
  if (filter.scored_group.empty()) return;
  SqlCondition scores = to->Next();
  scores.And("c.group_name = " + scores.Parameter(filter.scored_group));
  AndRange("c.entropy", filter.entropy_nats, &scores);
  AndRange("c.gain", filter.gain_nats, &scores);
  to->AndWithin(
      "EXISTS (SELECT 1 FROM segment_scores c WHERE c.rig = s.rig "
      "  AND c.sequence = s.sequence AND ",
      scores,
      ")");
}

// The column of the quantity that a list is sorted by.
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
    case SegmentQuery::Order::kAngularRate:
      return "s.angular_rate";
    case SegmentQuery::Order::kAcceleration:
      return "s.acceleration";
    case SegmentQuery::Order::kEntropy:
      return "o.entropy";
    case SegmentQuery::Order::kGain:
      return "o.gain";
  }
  return "s.sequence";
}

// True if the exclusions for the cause have indexes: it is rare.
bool HasIndex(ExclusionCause cause) { return cause >= ExclusionCause::kTooOld; }

// The table that is read in the order of a list, by an index.
enum class Source { kSegments, kScores, kExclusions };

Source SourceOf(const SegmentQuery& query) {
  switch (query.order) {
    case SegmentQuery::Order::kEntropy:
    case SegmentQuery::Order::kGain:
      return Source::kScores;
    case SegmentQuery::Order::kArrival:
      return query.excluded && HasIndex(*query.excluded) ? Source::kExclusions
                                                         : Source::kSegments;
    default:
      return Source::kSegments;
  }
}

const char* NameOf(Source source) {
  switch (source) {
    case Source::kSegments:
      return "s";
    case Source::kScores:
      return "o";
    case Source::kExclusions:
      return "a";
  }
  return "s";
}

// The source, with the segments under the name s.
const char* TablesOf(Source source) {
  switch (source) {
    case Source::kSegments:
      return "segments s";
    case Source::kScores:
      return "segments s JOIN segment_scores o "
             "ON o.rig = s.rig AND o.sequence = s.sequence";
    case Source::kExclusions:
      return "table_absences a JOIN segments s "
             "ON s.rig = a.rig AND s.sequence = a.sequence";
  }
  return "segments s";
}

// The rows of the source that belong to the list. A partial index is used only
// if its condition is repeated.
void AndSource(const SegmentQuery& query, Source source, SqlCondition* to) {
  switch (source) {
    case Source::kSegments:
      break;
    case Source::kScores:
      to->And("o.group_name = " + to->Parameter(query.order_group));
      return to->And(fmt::format("{} IS NOT NULL", KeyColumn(query.order)));
    case Source::kExclusions:
      to->And("a.cause = " +
              to->Parameter(std::int64_t{static_cast<int>(*query.excluded)}));
      return to->And("a.steady_ns IS NOT NULL");
  }
  switch (query.order) {
    case SegmentQuery::Order::kTemperature:
    case SegmentQuery::Order::kAngularRate:
    case SegmentQuery::Order::kAcceleration:
      return to->And(fmt::format("{} IS NOT NULL", KeyColumn(query.order)));
    default:
      return;
  }
}

// The columns that a list is sorted by; the first is the key. The index of the
// order has them all.
std::vector<std::string> OrderColumns(const SegmentQuery& query,
                                      Source source,
                                      bool of_all) {
  const bool by_arrival = query.order == SegmentQuery::Order::kArrival;
  const char* const table = NameOf(source);
  std::vector<std::string> columns;
  if (by_arrival && of_all) {
    columns.push_back(fmt::format("{}.steady_ns", table));
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
    // The column may be one of whole numbers.
    values.push_back(
        fmt::format("CAST({} AS DOUBLE PRECISION)", to->Parameter(after.key)));
  }
  if (of_all) values.push_back(to->Parameter(after.rig));
  values.push_back(to->Parameter(after.sequence));
  return values;
}

// The text has its length, so that none can look like that of another part.
std::string PartText(const std::optional<std::string>& value) {
  return value ? fmt::format("={}:{}", value->size(), *value) : "";
}

std::string TextOf(const SegmentProperties& filter) {
  return fmt::format("{}/{}/{}/{}/{}",
                     NumberText(filter.state),
                     PartText(filter.session),
                     filter.has_data ? (*filter.has_data ? "yes" : "no") : "",
                     PartText(filter.in_table),
                     NumberText(filter.excluded));
}

std::string TextOf(const SegmentRanges& filter) {
  return fmt::format("{}/{}/{}/{}/{}/{}/{}",
                     RangeText(filter.receive_time_ns),
                     RangeText(filter.calibration_version),
                     RangeText(filter.landmarks),
                     RangeText(filter.observations),
                     RangeText(filter.temperature_c),
                     RangeText(filter.angular_rate_radps),
                     RangeText(filter.acceleration_mps2));
}

std::string TextOf(const ScoreRanges& filter) {
  return fmt::format("{}/{}/{}",
                     PartText(filter.scored_group),
                     RangeText(filter.entropy_nats),
                     RangeText(filter.gain_nats));
}

std::string TextOf(const SegmentOrder& order) {
  return fmt::format("{}/{}/{}",
                     static_cast<int>(order.order),
                     PartText(order.order_group),
                     order.descending);
}

}  // namespace

std::string ListName(const std::string& rig,
                     const SegmentQuery& query,
                     const RigQuery& rigs) {
  std::string name = "segments/" + rig;
  if (rig.empty()) name += FilterText(rigs);
  if (query == SegmentQuery()) return name;
  const SegmentProperties& properties = query;
  const SegmentRanges& ranges = query;
  const ScoreRanges& scores = query;
  const SegmentOrder& order = query;
  return fmt::format("{}?{}/{}/{}/{}",
                     name,
                     TextOf(properties),
                     TextOf(ranges),
                     TextOf(scores),
                     TextOf(order));
}

absl::Status CheckOrderOfAll(const SegmentQuery& query) {
  switch (query.order) {
    case SegmentQuery::Order::kArrival:
    case SegmentQuery::Order::kTemperature:
    case SegmentQuery::Order::kAngularRate:
    case SegmentQuery::Order::kAcceleration:
    case SegmentQuery::Order::kGain:
      return absl::OkStatus();
    default:
      return absl::InvalidArgumentError(
          "the segments of all rigs can be sorted by receive_time, "
          "temperature_c, angular_rate, acceleration or gain.GROUP: name a rig "
          "to sort by this field");
  }
}

absl::StatusOr<std::optional<SegmentPlace>> PlaceOfPage(const std::string& list,
                                                        const Page& page) {
  SELFCAL_ASSIGN_OR_RETURN(const auto text, PageKey(list, page));
  if (!text) return std::nullopt;
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

std::string SelectPlaces(std::int64_t rig,
                         const SegmentQuery& query,
                         const RigQuery& rigs,
                         const std::optional<SegmentPlace>& after,
                         int limit,
                         SqlCondition* condition) {
  const bool of_all = rig == 0;
  const Source source = SourceOf(query);
  const char* const table = NameOf(source);
  AndSource(query, source, condition);
  if (!of_all) {
    condition->And(
        fmt::format("{}.rig = {}", table, condition->Parameter(rig)));
  }
  SegmentProperties properties = query;
  if (source == Source::kExclusions) properties.excluded.reset();
  AndProperties(properties, condition);
  AndRanges(query, condition);
  AndScores(query, condition);
  const auto order = OrderColumns(query, source, of_all);
  // A bound at the end of the index would hide that of a range of the query.
  if (after) {
    condition->And(fmt::format(
        "({}) {} ({})",
        fmt::join(order, ", "),
        query.descending ? "<" : ">",
        fmt::join(OrderValues(query, of_all, *after, condition), ", ")));
  }
  SqlCondition of_rigs = condition->Next();
  if (of_all) AddRigConditions(rigs, "r", &of_rigs);
  const bool some_rigs = !of_rigs.is_empty();
  if (some_rigs) condition->And(of_rigs);
  const std::string_view way = query.descending ? "DESC" : "ASC";
  return fmt::format("SELECT {}{} FROM {} {} WHERE {} ORDER BY {} {} LIMIT {}",
                     // A segment is excluded from several tables.
                     source == Source::kExclusions ? "DISTINCT " : "",
                     fmt::join(order, ", "),
                     TablesOf(source),
                     some_rigs ? "JOIN rigs r ON r.rig = s.rig" : "",
                     condition->sql(),
                     fmt::join(order, fmt::format(" {}, ", way)),
                     way,
                     limit);
}

SegmentPlace PlaceOfRow(std::int64_t rig,
                        const SegmentQuery& query,
                        const Statement& row) {
  SegmentPlace place;
  int column = 0;
  if (query.order != SegmentQuery::Order::kArrival) {
    place.key = row.Double(column++);
  } else if (rig == 0) {
    place.steady_ns = row.Int(column++);
  }
  place.rig = rig == 0 ? row.Int(column++) : rig;
  place.sequence = row.Int(column);
  return place;
}

}  // namespace selfcal::server
