#include "client/cli/old_spellings.h"

#include "client/cli/commands.h"

namespace selfcal::client {
namespace {

using AddCommand = CLI::App* (*)(CLI::App*, const std::string&, Context*);

struct OldSpelling {
  const char* old;
  const char* present;
  AddCommand add;
};

constexpr OldSpelling kOldSpellings[] = {
    {"backup", "daemon backup", AddBackup},
    {"coach", "rig coach", AddCoach},
    {"doctor", "daemon doctor", AddDoctor},
    {"events", "event list", AddEventList},
    {"import", "segment import", AddImport},
    {"preflight", "segment preflight", AddPreflight},
    {"recalibrate", "run start", AddRunStart},
    {"report", "calibration report", AddCalibrationReport},
    {"restore", "daemon restore", AddRestore},
    {"tables", "table show", AddTableShow},
    {"top", "daemon top", AddTop},
    {"verify", "rig verify", AddVerify}};

}  // namespace

const std::map<std::string, std::string>& OldSpellings() {
  static const auto& spellings = *[] {
    auto* const all = new std::map<std::string, std::string>;
    for (const OldSpelling& one : kOldSpellings) (*all)[one.old] = one.present;
    return all;
  }();
  return spellings;
}

void AddOldSpellings(CLI::App* app, Context* context) {
  for (const OldSpelling& one : kOldSpellings) {
    one.add(app, one.old, context)->group("");
  }
}

}  // namespace selfcal::client
