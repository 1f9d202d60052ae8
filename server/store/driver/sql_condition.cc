#include "server/store/driver/sql_condition.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <array>
#include <utility>

namespace selfcal::server {
namespace {

// The types of Value, in its order.
constexpr std::array kSqlTypes = {"BIGINT", "DOUBLE PRECISION", "TEXT"};

}  // namespace

std::string SqlCondition::Parameter(Value value) {
  values_.push_back(std::move(value));
  return "?" + std::to_string(next_++);
}

void SqlCondition::And(const std::string& condition) {
  reuse_ = Reuse::kOnce;
  if (!is_empty()) sql_ += " AND ";
  sql_ += condition;
}

void SqlCondition::AndIn(const std::string& columns,
                         const std::vector<std::vector<Value>>& rows) {
  std::vector<std::string> texts;
  for (const std::vector<Value>& row : rows) {
    std::vector<std::string> parameters;
    for (const Value& value : row) {
      const std::string parameter = Parameter(value);
      parameters.push_back(texts.empty() ? fmt::format("CAST({} AS {})",
                                                       parameter,
                                                       kSqlTypes[value.index()])
                                         : parameter);
    }
    texts.push_back(fmt::format("({})", fmt::join(parameters, ", ")));
  }
  const Reuse reuse = rows.size() == 1 ? reuse_ : Reuse::kOnce;
  // SQLite reads all rows of a table that it compares with plain VALUES.
  And(fmt::format("{} IN (SELECT * FROM (VALUES {}) AS any_of)",
                  columns,
                  fmt::join(texts, ", ")));
  reuse_ = reuse;
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
