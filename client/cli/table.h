// Rows of text, for a person at a terminal or for a program that reads a pipe.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace selfcal::client {

struct Column {
  std::string header;
  bool right = false;  // align right, for numbers
};

class Table {
 public:
  explicit Table(std::vector<Column> columns);

  // Adds a row. Missing cells are empty, excess cells are dropped. Tabs and
  // line breaks within a cell become spaces, other control characters '?'.
  void Add(std::vector<std::string> cells);

  // Aligned columns under their headers, for a terminal.
  std::string Aligned() const;

  // One record per line, cells separated by tabs, without a header.
  std::string Tabbed() const;

 private:
  std::vector<Column> columns_;
  std::vector<std::vector<std::string>> rows_;
};

// Lines "key:  value" with aligned values; in a pipe, "key<tab>value".
class Facts {
 public:
  void Add(std::string_view key, std::string value);
  std::string Aligned() const;
  std::string Tabbed() const;

 private:
  Table table_{{{"", false}, {"", false}}};
};

}  // namespace selfcal::client
