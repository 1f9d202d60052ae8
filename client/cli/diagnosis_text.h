// The findings of a pre-flight check, for people and for programs.
#pragma once

#include <google/protobuf/struct.pb.h>

#include <string>

#include "core/preflight/diagnose.h"

namespace selfcal::client {

// Text for a terminal: each finding with its remedy or, if there are no
// findings, what was checked; then what was not checked.
std::string DiagnosisText(const Diagnosis& diagnosis);

// Records for a pipe: kind, cause and remedy of each finding, separated by
// tabs; then a record for each check that was done ("checked") or not done
// ("not-checked").
std::string DiagnosisRecords(const Diagnosis& diagnosis);

// {"findings": [{"kind", "cause", "remedy", "value"}], "checked": [],
// "not_checked": []}
google::protobuf::Struct DiagnosisJson(const Diagnosis& diagnosis);

// Prints the findings to standard error, a line each.
void WarnOf(const Diagnosis& diagnosis);

}  // namespace selfcal::client
