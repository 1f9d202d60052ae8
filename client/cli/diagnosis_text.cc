#include "client/cli/diagnosis_text.h"

#include <fmt/format.h>

#include "client/cli/context.h"
#include "client/cli/table.h"

namespace selfcal::client {
namespace {

google::protobuf::Value Text(std::string_view text) {
  google::protobuf::Value value;
  value.set_string_value(std::string(text));
  return value;
}

google::protobuf::Value ListValue(const std::vector<std::string>& lines) {
  google::protobuf::Value value;
  value.mutable_list_value();
  for (const std::string& line : lines) {
    *value.mutable_list_value()->add_values() = Text(line);
  }
  return value;
}

}  // namespace

std::string DiagnosisText(const Diagnosis& diagnosis) {
  std::string text;
  for (const Finding& finding : diagnosis.findings) {
    text += fmt::format("{}: {}\n  {}\n",
                        FindingName(finding.kind),
                        finding.cause,
                        finding.remedy);
  }
  if (diagnosis.findings.empty()) {
    text += "nothing found; checked:\n";
    for (const std::string& line : diagnosis.checked) {
      text += fmt::format("  {}\n", line);
    }
  }
  for (const std::string& line : diagnosis.not_checked) {
    text += fmt::format("not checked: {}\n", line);
  }
  return text;
}

std::string DiagnosisRecords(const Diagnosis& diagnosis) {
  Table table({{"KIND"}, {"CAUSE"}, {"REMEDY"}});
  for (const Finding& finding : diagnosis.findings) {
    table.Add({std::string(FindingName(finding.kind)),
               finding.cause,
               finding.remedy});
  }
  for (const std::string& line : diagnosis.checked) {
    table.Add({"checked", line});
  }
  for (const std::string& line : diagnosis.not_checked) {
    table.Add({"not-checked", line});
  }
  return table.Tabbed();
}

google::protobuf::Struct DiagnosisJson(const Diagnosis& diagnosis) {
  google::protobuf::Struct document;
  auto& fields = *document.mutable_fields();
  auto* findings = fields["findings"].mutable_list_value();
  for (const Finding& finding : diagnosis.findings) {
    auto& one =
        *findings->add_values()->mutable_struct_value()->mutable_fields();
    one["kind"] = Text(FindingName(finding.kind));
    one["cause"] = Text(finding.cause);
    one["remedy"] = Text(finding.remedy);
    one["value"].set_number_value(finding.value);
    one["imu"].set_number_value(finding.imu);
  }
  fields["checked"] = ListValue(diagnosis.checked);
  fields["not_checked"] = ListValue(diagnosis.not_checked);
  return document;
}

void WarnOf(const Diagnosis& diagnosis) {
  for (const Finding& finding : diagnosis.findings) {
    PrintError(fmt::format("warning: {}: {}; {}",
                           FindingName(finding.kind),
                           finding.cause,
                           finding.remedy));
  }
}

}  // namespace selfcal::client
