#include "test/evaluation/table.h"

#include <fmt/format.h>

#include <cmath>
#include <stdexcept>
#include <utility>

namespace selfcal {
namespace {

std::string Text(const Cell& cell, int digits) {
  if (const auto* text = std::get_if<std::string>(&cell)) return *text;
  if (const auto* count = std::get_if<long>(&cell)) {
    return fmt::format("{}", *count);
  }
  if (const auto* number = std::get_if<double>(&cell)) {
    return fmt::format("{:.{}g}", *number, digits);
  }
  return "";
}

// RFC 4180.
std::string CsvField(const std::string& text) {
  if (text.find_first_of(",\"\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) {
    if (c == '"') quoted += '"';
    quoted += c;
  }
  return quoted + '"';
}

std::string MarkdownField(const std::string& text) {
  std::string escaped;
  for (const char c : text) {
    if (c == '|') escaped += '\\';
    escaped += c;
  }
  return escaped;
}

}  // namespace

ResultTable::ResultTable(std::vector<std::string> columns)
    : columns_(std::move(columns)) {}

void ResultTable::Add(std::vector<Cell> row) {
  if (row.size() != columns_.size()) {
    throw std::invalid_argument("a row has other cells than the table columns");
  }
  for (std::size_t i = 0; i < row.size(); ++i) {
    const auto* number = std::get_if<double>(&row[i]);
    if (number != nullptr && !std::isfinite(*number)) {
      throw std::invalid_argument("a number is not finite, in column " +
                                  columns_[i]);
    }
  }
  rows_.push_back(std::move(row));
}

std::string ResultTable::Csv() const {
  std::string text;
  for (std::size_t i = 0; i < columns_.size(); ++i) {
    text += (i == 0 ? "" : ",") + CsvField(columns_[i]);
  }
  text += "\n";
  for (const std::vector<Cell>& row : rows_) {
    for (std::size_t i = 0; i < row.size(); ++i) {
      text += (i == 0 ? "" : ",") + CsvField(Text(row[i], 10));
    }
    text += "\n";
  }
  return text;
}

std::string ResultTable::Markdown() const {
  std::string text = "|";
  std::string rule = "|";
  for (const std::string& column : columns_) {
    text += " " + MarkdownField(column) + " |";
    rule += " --- |";
  }
  text += "\n" + rule + "\n";
  for (const std::vector<Cell>& row : rows_) {
    text += "|";
    for (const Cell& cell : row)
      text += " " + MarkdownField(Text(cell, 4)) + " |";
    text += "\n";
  }
  return text;
}

}  // namespace selfcal
