#include "server/encode/calibration_filter.h"

#include "server/encode/filter_terms.h"
#include "server/encode/filter_values.h"
#include "server/status/status_macros.h"

namespace selfcal::server {
namespace {

absl::Status ApplyToVersions(const FilterTerm& term, CalibrationQuery* query) {
  if (term.group.empty()) {
    if (term.field == "state") {
      return ReadWord(term,
                      "a state",
                      {{"ACTIVE", CalibrationState::kActive},
                       {"SUPERSEDED", CalibrationState::kSuperseded},
                       {"REJECTED", CalibrationState::kRejected},
                       {"CANDIDATE", CalibrationState::kCandidate},
                       {"ROLLED_BACK", CalibrationState::kRolledBack}},
                      &query->state);
    }
    if (term.field == "verdict") {
      return ReadWord(term,
                      "a verdict",
                      {{"GOOD", VerdictKind::kGood},
                       {"WEAK", VerdictKind::kWeak},
                       {"NOT_TRUSTWORTHY", VerdictKind::kNotTrustworthy},
                       {"FACTORY", VerdictKind::kFactory},
                       {"UNKNOWN", VerdictKind::kUnknown}},
                      &query->verdict);
    }
    if (term.field == "create_time") {
      return NarrowByTime(term, &query->create_time_ns);
    }
    if (term.field == "temperature_c") {
      return NarrowByNumber(term, &query->temperature_c);
    }
  }
  return NotWhatIsExpected(
      term.field, "a field: state, verdict, create_time or temperature_c");
}

}  // namespace

absl::Status ParseCalibrationFilter(std::string_view filter,
                                    CalibrationQuery* query) {
  return ForEachTerm(
      filter, LoneTexts::kRefused, [query](const FilterTerm& term) {
        return ApplyToVersions(term, query);
      });
}

absl::Status ParseCalibrationOrder(std::string_view order_by,
                                   CalibrationQuery* query) {
  if (order_by.empty()) return absl::OkStatus();
  SELFCAL_ASSIGN_OR_RETURN(const ListOrder order, ParseOrder(order_by, "desc"));
  query->descending = order.descending;
  if (order.field == "create_time") {
    query->order = CalibrationQuery::Order::kCreation;
  } else if (order.field == "temperature_c") {
    query->order = CalibrationQuery::Order::kTemperature;
  } else {
    return NotWhatIsExpected(order.field,
                             "a field to sort by: create_time or "
                             "temperature_c");
  }
  return absl::OkStatus();
}

}  // namespace selfcal::server
