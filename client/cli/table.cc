#include "client/cli/table.h"

#include <algorithm>
#include <utility>

#include "client/cli/cell_style.h"
#include "proto/safe_text.h"

namespace selfcal::client {
namespace {

constexpr std::string_view kGap = "  ";
constexpr std::string_view kDots = "...";
constexpr std::size_t kNarrowest = 12;      // of a column that is shortened
constexpr std::size_t kNarrowestText = 16;  // of one that is continued

// Number of UTF-8 characters, not of bytes.
std::size_t Width(std::string_view text) {
  return static_cast<std::size_t>(
      std::count_if(text.begin(), text.end(), [](char c) {
        return (static_cast<unsigned char>(c) & 0xc0) != 0x80;
      }));
}

std::string Cell(std::string text) {
  std::replace_if(
      text.begin(),
      text.end(),
      [](char c) { return c == '\t' || c == '\n' || c == '\r'; },
      ' ');
  return SafeLine(text);
}

// Length in bytes of the first `count` UTF-8 characters.
std::size_t BytesOf(std::string_view text, std::size_t count) {
  std::size_t end = 0;
  for (; end < text.size(); ++end) {
    const bool first = (static_cast<unsigned char>(text[end]) & 0xc0) != 0x80;
    if (first && count-- == 0) break;
  }
  return end;
}

// Narrows the widest columns that are aligned left until a line fits.
void Narrow(const std::vector<Column>& columns,
            std::size_t limit,
            std::vector<std::size_t>* widths) {
  std::size_t total = kGap.size() * (widths->size() - 1);
  for (const std::size_t width : *widths) total += width;
  while (total > limit) {
    std::size_t* widest = nullptr;
    for (std::size_t c = 0; c < columns.size(); ++c) {
      std::size_t& width = (*widths)[c];
      const std::size_t least =
          columns[c].text ? kNarrowestText
                          : std::max(kNarrowest, Width(columns[c].header));
      if (columns[c].right || width <= least) continue;
      if (widest == nullptr || width > *widest) widest = &width;
    }
    if (widest == nullptr) return;
    --*widest;
    --total;
  }
}

// Splits a text at spaces, or within words that are too long, into lines of
// this width; at least one.
std::vector<std::string> Wrapped(std::string_view text, std::size_t width) {
  std::vector<std::string> lines;
  while (Width(text) > width) {
    const std::size_t most = BytesOf(text, width);
    const std::size_t space = text.rfind(' ', most);
    const bool at_space = space != text.npos && space > 0;
    lines.emplace_back(text.substr(0, at_space ? space : most));
    text.remove_prefix(at_space ? space + 1 : most);
  }
  lines.emplace_back(text);
  return lines;
}

// The column of a cell; rows without headers are facts, which begin with it.
const std::string& ColumnOf(const std::vector<Column>& columns,
                            const std::vector<std::string>& cells,
                            std::size_t c) {
  return columns[c].header.empty() ? cells[0] : columns[c].header;
}

enum class Row { kHeaders, kCells };

std::string Line(const std::vector<Column>& columns,
                 const std::vector<std::size_t>& widths,
                 const std::vector<std::string>& cells,
                 Row row,
                 bool color) {
  std::string line;
  for (std::size_t c = 0; c < cells.size(); ++c) {
    const std::string cell = ShortenedInTheMiddle(cells[c], widths[c]);
    const std::string padding(widths[c] - Width(cell), ' ');
    // Nothing is padded at the end of a line.
    const bool ends =
        std::all_of(cells.begin() + static_cast<std::ptrdiff_t>(c) + 1,
                    cells.end(),
                    [](const std::string& later) { return later.empty(); });
    std::string padded = columns[c].right ? padding + cell
                         : ends           ? cell
                                          : cell + padding;
    if (color) {
      padded = row == Row::kHeaders ? StyledHeader(padded)
                                    : StyledCell(ColumnOf(columns, cells, c),
                                                 cells[c],
                                                 std::move(padded));
    }
    if (c > 0) line += kGap;
    line += padded;
    if (ends) break;
  }
  line.erase(line.find_last_not_of(' ') + 1);
  return line + "\n";
}

}  // namespace

Table::Table(std::vector<Column> columns) : columns_(std::move(columns)) {}

void Table::Add(std::vector<std::string> cells) {
  cells.resize(columns_.size());
  for (std::string& cell : cells) cell = Cell(std::move(cell));
  rows_.push_back(std::move(cells));
}

std::string Table::Aligned(const Layout& layout) const {
  std::vector<std::string> headers;
  std::vector<std::size_t> widths;
  for (std::size_t c = 0; c < columns_.size(); ++c) {
    headers.push_back(columns_[c].header);
    widths.push_back(Width(columns_[c].header));
    for (const auto& row : rows_) {
      widths[c] = std::max(widths[c], Width(row[c]));
    }
  }
  const bool has_headers =
      std::any_of(headers.begin(), headers.end(), [](const std::string& h) {
        return !h.empty();
      });
  // Facts have no headers; their values are for reading, not for finding.
  if (has_headers && layout.columns > 0) {
    Narrow(columns_, layout.columns, &widths);
  }
  std::string text;
  if (has_headers) {
    text += Line(columns_, widths, headers, Row::kHeaders, layout.color);
  }
  for (std::vector<std::string> row : rows_) {
    std::vector<std::string> lines = {row.back()};
    if (columns_.back().text) lines = Wrapped(row.back(), widths.back());
    for (std::string& line : lines) {
      row.back() = std::move(line);
      text += Line(columns_, widths, row, Row::kCells, layout.color);
      std::fill(row.begin(), row.end(), "");
    }
  }
  return text;
}

std::string Table::Tabbed(bool color) const {
  std::string text;
  for (const auto& row : rows_) {
    for (std::size_t c = 0; c < row.size(); ++c) {
      if (c > 0) text += '\t';
      text += color ? StyledCell(ColumnOf(columns_, row, c), row[c], row[c])
                    : row[c];
    }
    text += '\n';
  }
  return text;
}

void Facts::Add(std::string_view key, std::string value) {
  table_.Add({std::string(key), std::move(value)});
}

std::string Facts::Aligned(const Layout& layout) const {
  return table_.Aligned(layout);
}

std::string Facts::Tabbed(bool color) const { return table_.Tabbed(color); }

std::string ShortenedInTheMiddle(const std::string& text, std::size_t width) {
  const std::size_t characters = Width(text);
  if (characters <= width) return text;
  if (width <= kDots.size()) return text.substr(0, BytesOf(text, width));
  const std::size_t end = (width - kDots.size()) / 2;
  const std::size_t begin = width - kDots.size() - end;
  return text.substr(0, BytesOf(text, begin)) + std::string(kDots) +
         text.substr(BytesOf(text, characters - end));
}

}  // namespace selfcal::client
