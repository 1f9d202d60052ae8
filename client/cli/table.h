// Rows of text, for a person at a terminal or for a program that reads a pipe.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace selfcal::client {

struct Column {
  std::string header;
  bool right = false;  // align right, for numbers
  // A text to read, in the last column: it continues on the lines below, where
  // names are shortened.
  bool text = false;
};

// Layout of a table.
struct Layout {
  std::size_t columns = 0;  // width of the terminal; 0: unlimited
  bool color = false;
};

class Table {
 public:
  explicit Table(std::vector<Column> columns);

  // Adds a row. Missing cells are empty, excess cells are dropped. Tabs and
  // line breaks within a cell become spaces, other control characters '?'.
  void Add(std::vector<std::string> cells);

  // Aligned columns under their headers, for a terminal. Names, which are
  // aligned left, are shortened in the middle until a line fits, as far as they
  // stay legible.
  std::string Aligned(const Layout& layout = {}) const;

  // One record per line, cells separated by tabs, without a header.
  std::string Tabbed(bool color = false) const;

 private:
  std::vector<Column> columns_;
  std::vector<std::vector<std::string>> rows_;
};

// Lines "key:  value" with aligned values; in a pipe, "key<tab>value".
class Facts {
 public:
  void Add(std::string_view key, std::string value);
  std::string Aligned(const Layout& layout = {}) const;
  std::string Tabbed(bool color = false) const;

 private:
  Table table_{{{"", false}, {"", false}}};
};

// Returns the text with at most this many characters: "walk_2026...part~3".
std::string ShortenedInTheMiddle(const std::string& text, std::size_t width);

}  // namespace selfcal::client
