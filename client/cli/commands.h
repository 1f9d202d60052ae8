// The commands, sorted by noun; each function adds its commands to the command
// line. `context` must outlive the command line.
#pragma once

#include <CLI/CLI.hpp>

#include "client/cli/context.h"

namespace selfcal::client {

void AddRigCommands(CLI::App* app, Context* context);
// Adds commands below `rig`.
void AddRigChanges(CLI::App* rig, Context* context);
void AddImportCommand(CLI::App* app, Context* context);
void AddPreflightCommand(CLI::App* app, Context* context);
void AddSegmentCommands(CLI::App* app, Context* context);
// Each adds commands below `segments`.
void AddSegmentDetails(CLI::App* segments, Context* context);
void AddSegmentExport(CLI::App* segments, Context* context);
void AddSessionCommands(CLI::App* app, Context* context);
void AddTablesCommand(CLI::App* app, Context* context);
void AddRecalibrateCommand(CLI::App* app, Context* context);
void AddRunCommands(CLI::App* app, Context* context);
void AddCalibrationCommands(CLI::App* app, Context* context);
void AddReportCommand(CLI::App* app, Context* context);
void AddCoachCommand(CLI::App* app, Context* context);
// Adds a command below `calibrations`.
void AddCalibrationExport(CLI::App* calibrations, Context* context);
void AddVerifyCommand(CLI::App* app, Context* context);
void AddTopCommand(CLI::App* app, Context* context);
void AddEventsCommand(CLI::App* app, Context* context);
void AddDoctorCommand(CLI::App* app, Context* context);
void AddBackupCommand(CLI::App* app, Context* context);
void AddRestoreCommand(CLI::App* app, Context* context);
void AddCompletionCommand(CLI::App* app, Context* context);

// Parses and runs the command line; returns the exit code.
int RunCommandLine(int argc, const char* const* argv);

}  // namespace selfcal::client
