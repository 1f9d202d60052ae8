// HTML as text. Whatever comes from the daemon goes through Escaped.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace selfcal::client {

// As text or in a quoted attribute. Bytes that are no character of HTML become
// '?'.
std::string Escaped(std::string_view text);

struct HtmlColumn {
  std::string title;
  bool number = false;  // to the right
};

// Cells are HTML already.
class HtmlTable {
 public:
  explicit HtmlTable(std::vector<HtmlColumn> columns);
  void Add(const std::vector<std::string>& cells);
  std::string Html() const;

 private:
  std::vector<HtmlColumn> columns_;
  std::string rows_;
};

// A section with its heading, which the page's list of contents can name.
std::string Section(std::string_view id,
                    std::string_view title,
                    std::string_view body);

// The page: everything in one file, no scripts, dark where the reader is.
std::string Page(std::string_view title, std::string_view body);

}  // namespace selfcal::client
