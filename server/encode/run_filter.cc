#include "server/encode/run_filter.h"

#include "server/encode/filter_terms.h"
#include "server/encode/filter_values.h"
#include "server/status/status_macros.h"

namespace selfcal::server {
namespace {

absl::Status ApplyToRuns(const FilterTerm& term, RunQuery* query) {
  if (term.group.empty()) {
    if (term.field == "state") {
      return ReadWord(term,
                      "a state",
                      {{"PENDING", RunState::kPending},
                       {"RUNNING", RunState::kRunning},
                       {"SUCCEEDED", RunState::kSucceeded},
                       {"FAILED", RunState::kFailed},
                       {"CANCELLED", RunState::kCancelled}},
                      &query->state);
    }
    if (term.field == "trigger") {
      return ReadWord(term,
                      "a trigger",
                      {{"TABLES_FULL", RunTrigger::kTablesFull},
                       {"TABLES_CHANGED", RunTrigger::kTablesChanged},
                       {"MANUAL", RunTrigger::kManual},
                       {"CHANGE_DETECTED", RunTrigger::kChangeDetected},
                       {"CALIBRATION_AGED", RunTrigger::kCalibrationAged},
                       {"SESSION_ENDED", RunTrigger::kSessionEnded}},
                      &query->trigger);
    }
    if (term.field == "create_time") {
      return NarrowByTime(term, &query->create_time_ns);
    }
  }
  return NotWhatIsExpected(term.field,
                           "a field: state, trigger or create_time");
}

}  // namespace

absl::Status ParseRunFilter(std::string_view filter, RunQuery* query) {
  return ForEachTerm(
      filter, LoneTexts::kRefused, [query](const FilterTerm& term) {
        return ApplyToRuns(term, query);
      });
}

absl::Status ParseRunOrder(std::string_view order_by, RunQuery* query) {
  if (order_by.empty()) return absl::OkStatus();
  SELFCAL_ASSIGN_OR_RETURN(const ListOrder order, ParseOrder(order_by, "desc"));
  query->descending = order.descending;
  if (order.field == "create_time") {
    query->order = RunQuery::Order::kCreation;
  } else if (order.field == "duration") {
    query->order = RunQuery::Order::kDuration;
  } else {
    return NotWhatIsExpected(order.field,
                             "a field to sort by: create_time or duration");
  }
  return absl::OkStatus();
}

}  // namespace selfcal::server
