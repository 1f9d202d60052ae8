#include "server/encode/rig_filter.h"

#include "server/encode/filter_terms.h"
#include "server/status/status_macros.h"

namespace selfcal::server {

absl::Status ParseRigFilter(std::string_view filter, RigQuery* query) {
  const auto apply = [query](const FilterTerm& term) -> absl::Status {
    if (term.field.empty()) {
      if (!query->text.empty()) {
        return NotWhatIsExpected(term.value,
                                 "a condition: give one text for the name");
      }
      query->text = term.value;
      return absl::OkStatus();
    }
    const bool is_name = term.field == "name" && term.group.empty();
    const bool is_label = term.field == "labels" && !term.group.empty();
    if ((!is_name && !is_label) || term.sign != "=") {
      return NotWhatIsExpected(term.field,
                               "a condition: name = RIG, labels.NAME = VALUE, "
                               "or a text alone");
    }
    if (is_label) {
      query->labels[term.group] = term.value;
      return absl::OkStatus();
    }
    if (term.value.empty() || !query->name.empty()) {
      return NotWhatIsExpected(term.value, "a condition: give one name");
    }
    query->name = term.value;
    return absl::OkStatus();
  };
  return ForEachTerm(filter, LoneTexts::kAllowed, apply);
}

absl::Status ParseRigOrder(std::string_view order_by, RigQuery* query) {
  if (order_by.empty()) return absl::OkStatus();
  SELFCAL_ASSIGN_OR_RETURN(const ListOrder order, ParseOrder(order_by, "asc"));
  if (order.field == "name") {
    query->order = RigQuery::Order::kName;
  } else if (order.field == "last_seen") {
    query->order = RigQuery::Order::kLastSeen;
  } else if (order.field == "alarms") {
    query->order = RigQuery::Order::kAlarms;
  } else {
    return NotWhatIsExpected(order.field,
                             "a field to sort by: name, last_seen or alarms");
  }
  query->descending = order.descending;
  return absl::OkStatus();
}

}  // namespace selfcal::server
