#include "server/store/driver/sql_condition.h"

#include <utility>

namespace selfcal::server {

std::string SqlCondition::Parameter(Value value) {
  values_.push_back(std::move(value));
  return "?" + std::to_string(next_++);
}

void SqlCondition::And(const std::string& condition) {
  if (!is_empty()) sql_ += " AND ";
  sql_ += condition;
}

void SqlCondition::AndWithin(const std::string& before,
                             const SqlCondition& next,
                             const std::string& after) {
  And(before + next.sql() + after);
  values_.insert(values_.end(), next.values_.begin(), next.values_.end());
  next_ = next.next_;
}

void SqlCondition::Bind(Statement* statement) const {
  for (const Value& value : values_) {
    std::visit([&](const auto& bound) { statement->BindNext(bound); }, value);
  }
}

}  // namespace selfcal::server
