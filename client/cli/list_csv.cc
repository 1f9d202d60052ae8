#include "client/cli/list_csv.h"

#include <fmt/format.h>
#include <google/protobuf/descriptor.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <string_view>
#include <utility>
#include <vector>

#include "client/cli/context.h"
#include "client/cli/csv_field.h"
#include "proto/safe_text.h"

namespace selfcal::client {
namespace {

using google::protobuf::FieldDescriptor;
using google::protobuf::Message;
using Row = std::vector<std::pair<std::string, std::string>>;  // column, cell

std::string Text(std::string_view text) {
  std::string safe = SafeLine(text);
  const bool is_formula = safe.size() > 1 && std::string_view("=+-@").find(
                                                 safe[0]) != std::string::npos;
  return is_formula ? "'" + safe : safe;
}

std::string Number(double value) {
  return std::isfinite(value) ? fmt::format("{}", value) : "";
}

std::string Json(const Message& message) {
  std::string json = ToJson(message, /*line=*/true);
  json.pop_back();  // the end of the line
  return json;
}

// The cell of a field that is set and no message, or of the element `index` of
// a repeated one.
std::string Scalar(const Message& message,
                   const FieldDescriptor* field,
                   int index = -1) {
  const auto* reflection = message.GetReflection();
  const auto get = [&](auto one, auto of_many) {
    return index < 0 ? (reflection->*one)(message, field)
                     : (reflection->*of_many)(message, field, index);
  };
  using Reflection = google::protobuf::Reflection;
  switch (field->cpp_type()) {
    case FieldDescriptor::CPPTYPE_INT32:
      return std::to_string(
          get(&Reflection::GetInt32, &Reflection::GetRepeatedInt32));
    case FieldDescriptor::CPPTYPE_INT64:
      return std::to_string(
          get(&Reflection::GetInt64, &Reflection::GetRepeatedInt64));
    case FieldDescriptor::CPPTYPE_UINT32:
      return std::to_string(
          get(&Reflection::GetUInt32, &Reflection::GetRepeatedUInt32));
    case FieldDescriptor::CPPTYPE_UINT64:
      return std::to_string(
          get(&Reflection::GetUInt64, &Reflection::GetRepeatedUInt64));
    case FieldDescriptor::CPPTYPE_DOUBLE:
      return Number(
          get(&Reflection::GetDouble, &Reflection::GetRepeatedDouble));
    case FieldDescriptor::CPPTYPE_FLOAT:
      return Number(get(&Reflection::GetFloat, &Reflection::GetRepeatedFloat));
    case FieldDescriptor::CPPTYPE_BOOL:
      return get(&Reflection::GetBool, &Reflection::GetRepeatedBool) ? "true"
                                                                     : "false";
    case FieldDescriptor::CPPTYPE_ENUM:
      return get(&Reflection::GetEnum, &Reflection::GetRepeatedEnum)->name();
    case FieldDescriptor::CPPTYPE_STRING:
      return Text(get(&Reflection::GetString, &Reflection::GetRepeatedString));
    case FieldDescriptor::CPPTYPE_MESSAGE:
      break;
  }
  return "";
}

void AddFields(const Message& message,
               const std::string& prefix,
               bool is_set,
               Row* row);

// The keys of messages that begin with a name; empty if these do not, or if two
// have the same.
std::vector<std::string> KeysOf(const Message& message,
                                const FieldDescriptor* field) {
  const FieldDescriptor* const key =
      field->message_type()->FindFieldByNumber(1);
  if (key == nullptr || key->is_repeated() ||
      key->type() != FieldDescriptor::TYPE_STRING) {
    return {};
  }
  const auto* reflection = message.GetReflection();
  std::vector<std::string> keys;
  for (int k = 0; k < reflection->FieldSize(message, field); ++k) {
    const Message& element = reflection->GetRepeatedMessage(message, field, k);
    keys.push_back(SafeLine(element.GetReflection()->GetString(element, key)));
  }
  const std::set<std::string> different(keys.begin(), keys.end());
  return different.size() == keys.size() && !different.contains("")
             ? keys
             : std::vector<std::string>();
}

void AddMap(const Message& message,
            const FieldDescriptor* field,
            const std::string& name,
            Row* row) {
  const auto* reflection = message.GetReflection();
  std::map<std::string, std::string> cells;
  for (int k = 0; k < reflection->FieldSize(message, field); ++k) {
    const Message& entry = reflection->GetRepeatedMessage(message, field, k);
    const auto* type = field->message_type();
    const std::string key = Scalar(entry, type->map_key());
    cells[key] =
        type->map_value()->cpp_type() == FieldDescriptor::CPPTYPE_MESSAGE
            ? Json(entry.GetReflection()->GetMessage(entry, type->map_value()))
            : Scalar(entry, type->map_value());
  }
  for (auto& [key, cell] : cells) {
    row->emplace_back(name + "." + key, std::move(cell));
  }
}

void AddRepeated(const Message& message,
                 const FieldDescriptor* field,
                 const std::string& name,
                 Row* row) {
  const auto* reflection = message.GetReflection();
  const int size = reflection->FieldSize(message, field);
  if (field->cpp_type() != FieldDescriptor::CPPTYPE_MESSAGE) {
    std::string cell;
    for (int k = 0; k < size; ++k) {
      cell += (k > 0 ? "; " : "") + Scalar(message, field, k);
    }
    row->emplace_back(name, std::move(cell));
    return;
  }
  const std::vector<std::string> keys = KeysOf(message, field);
  std::string json;
  for (int k = 0; k < size; ++k) {
    const Message& element = reflection->GetRepeatedMessage(message, field, k);
    if (keys.empty()) {
      json += (k > 0 ? "," : "") + Json(element);
    } else {
      AddFields(element, name + "." + keys[k] + ".", true, row);
    }
  }
  if (keys.empty() && size > 0) row->emplace_back(name, "[" + json + "]");
}

void AddField(const Message& message,
              const FieldDescriptor* field,
              const std::string& name,
              bool is_set,
              Row* row) {
  if (field->is_map()) return AddMap(message, field, name, row);
  if (field->is_repeated()) return AddRepeated(message, field, name, row);
  const auto* reflection = message.GetReflection();
  const bool has = is_set && (!field->has_presence() ||
                              reflection->HasField(message, field));
  if (field->cpp_type() != FieldDescriptor::CPPTYPE_MESSAGE) {
    row->emplace_back(name, has ? Scalar(message, field) : "");
    return;
  }
  const Message& part = reflection->GetMessage(message, field);
  const std::string& type = field->message_type()->full_name();
  if (type == "google.protobuf.Timestamp" ||
      type == "google.protobuf.Duration") {
    const std::string quoted = Json(part);
    row->emplace_back(name, has ? quoted.substr(1, quoted.size() - 2) : "");
  } else {
    AddFields(part, name + ".", has, row);
  }
}

void AddFields(const Message& message,
               const std::string& prefix,
               bool is_set,
               Row* row) {
  const auto* descriptor = message.GetDescriptor();
  for (int k = 0; k < descriptor->field_count(); ++k) {
    const FieldDescriptor* const field = descriptor->field(k);
    AddField(message, field, prefix + field->name(), is_set, row);
  }
}

// Adds those that are new, each after the one that it follows in the row.
void MergeColumns(const Row& row, std::vector<std::string>* columns) {
  auto after = columns->begin();
  for (const auto& [column, cell] : row) {
    auto found = std::find(columns->begin(), columns->end(), column);
    if (found == columns->end()) found = columns->insert(after, column);
    after = found + 1;
  }
}

std::string Line(const std::vector<std::string>& cells) {
  std::string line;
  for (const std::string& cell : cells) line += CsvField(cell) + ',';
  line.back() = '\r';  // in place of the last comma
  return line + '\n';
}

const FieldDescriptor* ItemsOf(const Message& list) {
  const auto* descriptor = list.GetDescriptor();
  for (int k = 0; k < descriptor->field_count(); ++k) {
    const FieldDescriptor* const field = descriptor->field(k);
    if (field->is_repeated() && field->message_type() != nullptr) return field;
  }
  return nullptr;
}

}  // namespace

std::string ListCsv(const Message& list) {
  const FieldDescriptor* const items = ItemsOf(list);
  if (items == nullptr) return "";
  const auto* reflection = list.GetReflection();
  std::vector<std::string> columns;
  // A list without items has the columns that do not depend on them.
  Row none;
  AddFields(
      *reflection->GetMessageFactory()->GetPrototype(items->message_type()),
      "",
      false,
      &none);
  MergeColumns(none, &columns);
  std::vector<std::map<std::string, std::string>> rows;
  for (int k = 0; k < reflection->FieldSize(list, items); ++k) {
    Row row;
    AddFields(reflection->GetRepeatedMessage(list, items, k), "", true, &row);
    MergeColumns(row, &columns);
    rows.emplace_back(row.begin(), row.end());
  }
  std::string csv = Line(columns);
  for (auto& row : rows) {
    std::vector<std::string> cells;
    for (const std::string& column : columns) cells.push_back(row[column]);
    csv += Line(cells);
  }
  return csv;
}

}  // namespace selfcal::client
