#include "client/cli/table.h"

#include <algorithm>
#include <utility>

#include "proto/safe_text.h"

namespace selfcal::client {
namespace {

constexpr std::string_view kGap = "  ";

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

void AppendLine(const std::vector<Column>& columns,
                const std::vector<std::size_t>& widths,
                const std::vector<std::string>& cells,
                std::string* text) {
  std::string line;
  for (std::size_t c = 0; c < cells.size(); ++c) {
    const std::string padding(widths[c] - Width(cells[c]), ' ');
    if (c > 0) line += kGap;
    line += columns[c].right ? padding + cells[c] : cells[c] + padding;
  }
  line.erase(line.find_last_not_of(' ') + 1);
  *text += line + "\n";
}

}  // namespace

Table::Table(std::vector<Column> columns) : columns_(std::move(columns)) {}

void Table::Add(std::vector<std::string> cells) {
  cells.resize(columns_.size());
  for (std::string& cell : cells) cell = Cell(std::move(cell));
  rows_.push_back(std::move(cells));
}

std::string Table::Aligned() const {
  std::vector<std::string> headers;
  std::vector<std::size_t> widths;
  for (std::size_t c = 0; c < columns_.size(); ++c) {
    headers.push_back(columns_[c].header);
    widths.push_back(Width(columns_[c].header));
    for (const auto& row : rows_) {
      widths[c] = std::max(widths[c], Width(row[c]));
    }
  }
  std::string text;
  const bool has_headers =
      std::any_of(headers.begin(), headers.end(), [](const std::string& h) {
        return !h.empty();
      });
  if (has_headers) AppendLine(columns_, widths, headers, &text);
  for (const auto& row : rows_) AppendLine(columns_, widths, row, &text);
  return text;
}

std::string Table::Tabbed() const {
  std::string text;
  for (const auto& row : rows_) {
    for (std::size_t c = 0; c < row.size(); ++c) {
      if (c > 0) text += '\t';
      text += row[c];
    }
    text += '\n';
  }
  return text;
}

void Facts::Add(std::string_view key, std::string value) {
  table_.Add({std::string(key), std::move(value)});
}

std::string Facts::Aligned() const { return table_.Aligned(); }

std::string Facts::Tabbed() const { return table_.Tabbed(); }

}  // namespace selfcal::client
