// Builders of HTML text. All text from the daemon must go through Escaped.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace selfcal::client {

// Escapes text for element content or a quoted attribute. Bytes that are not
// valid in HTML become '?'.
std::string Escaped(std::string_view text);

struct HtmlColumn {
  std::string title;
  bool number = false;  // align right
};

// A table; its cells are HTML, so text has to be escaped before.
class HtmlTable {
 public:
  explicit HtmlTable(std::vector<HtmlColumn> columns);
  void Add(const std::vector<std::string>& cells);
  std::string Html() const;

 private:
  std::vector<HtmlColumn> columns_;
  std::string rows_;
};

// A section with its heading; `id` is the anchor for links.
std::string Section(std::string_view id,
                    std::string_view title,
                    std::string_view body);

// The page: everything in one file, without scripts, with a dark mode if the
// reader prefers it.
std::string Page(std::string_view title, std::string_view body);

}  // namespace selfcal::client
