// What a pre-flight found, for people and for programs.
#pragma once

#include <google/protobuf/struct.pb.h>

#include <string>

#include "core/preflight/diagnose.h"

namespace selfcal::client {

// For a terminal: each finding with its remedy; without one what was checked;
// always what was not.
std::string DiagnosisText(const Diagnosis& diagnosis);

// For a pipe: kind, cause and remedy, separated by tabs; then "checked" and
// "not-checked" with a line of what.
std::string DiagnosisRecords(const Diagnosis& diagnosis);

// {"findings": [{"kind", "cause", "remedy", "value"}], "checked": [],
// "not_checked": []}
google::protobuf::Struct DiagnosisJson(const Diagnosis& diagnosis);

// Each finding on standard error, a line each.
void WarnOf(const Diagnosis& diagnosis);

}  // namespace selfcal::client
