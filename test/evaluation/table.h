// A table of results: rows of text and numbers, as CSV and as Markdown.
#pragma once

#include <string>
#include <variant>
#include <vector>

namespace selfcal {

// Text, a count, a number that may be rounded for reading, or nothing.
using Cell = std::variant<std::monostate, std::string, long, double>;

class ResultTable {
 public:
  explicit ResultTable(std::vector<std::string> columns);

  // As many cells as columns. Throws std::invalid_argument for a number that is
  // not finite: what does not exist is an empty cell.
  void Add(std::vector<Cell> row);

  // Numbers with 10 significant digits.
  std::string Csv() const;
  // Numbers with 4 significant digits.
  std::string Markdown() const;

 private:
  std::vector<std::string> columns_;
  std::vector<std::vector<Cell>> rows_;
};

}  // namespace selfcal
