// A condition of SQL whose parts are known only when it is made, with the
// values of their parameters.
#pragma once

#include <cstdint>
#include <string>
#include <variant>
#include <vector>

#include "server/store/driver/statement.h"

namespace selfcal::server {

class SqlCondition {
 public:
  using Value = std::variant<std::int64_t, double, std::string>;

  // Its parameters are numbered from this one on.
  explicit SqlCondition(int first_parameter = 1) : next_(first_parameter) {}

  // Adds a value; returns its parameter, such as ?3.
  std::string Parameter(Value value);
  void And(const std::string& condition);
  // `columns`, e.g. "(a, b)", are one of these rows of values, of which there
  // must be some. Their first one sets the types.
  void AndIn(const std::string& columns,
             const std::vector<std::vector<Value>>& rows);
  // The same of one column.
  template <typename Values>
  void AndOneOf(const std::string& column, const Values& values) {
    std::vector<std::vector<Value>> rows;
    for (const auto& value : values) rows.push_back({value});
    AndIn(column, rows);
  }
  // An empty condition whose parameters follow those of this one; once it is
  // added, its values follow as well.
  SqlCondition Next() const { return SqlCondition(next_); }
  void And(const SqlCondition& next) { AndWithin("", next, ""); }
  // The same with texts before and after it.
  void AndWithin(const std::string& before,
                 const SqlCondition& next,
                 const std::string& after);

  bool is_empty() const { return sql_.empty(); }
  // "TRUE" if it is empty.
  std::string sql() const { return is_empty() ? "TRUE" : sql_; }
  // Binds the values, as the next parameters of the statement. They must
  // outlive it.
  void Bind(Statement* statement) const;
  // A statement whose text contains the condition is worth keeping if that is
  // empty, or a single row of AndIn: there are few such texts.
  Reuse reuse() const { return reuse_; }

 private:
  int next_;
  std::string sql_;
  std::vector<Value> values_;
  Reuse reuse_ = Reuse::kKept;
};

}  // namespace selfcal::server
