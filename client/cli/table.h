// Rows of text for a person at a terminal or for a program behind a pipe.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace selfcal::client {

struct Column {
  std::string header;
  bool right = false;  // numbers
};

class Table {
 public:
  explicit Table(std::vector<Column> columns);

  // Cells that are missing are empty, those in excess are left out.
  void Add(std::vector<std::string> cells);

  // Aligned columns under their headers, for a terminal.
  std::string Aligned() const;

  // One record a line, cells separated by a tab, no header. Tabs and line
  // breaks within a cell become spaces.
  std::string Tabbed() const;

 private:
  std::vector<Column> columns_;
  std::vector<std::vector<std::string>> rows_;
};

// "key:  value" lines, the values aligned; a pipe gets "key<tab>value".
class Facts {
 public:
  void Add(std::string_view key, std::string value);
  std::string Aligned() const;
  std::string Tabbed() const;

 private:
  Table table_{{{"", false}, {"", false}}};
};

}  // namespace selfcal::client
