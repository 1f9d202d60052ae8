// The commands. Each function adds commands to the command line: a noun with
// its verbs, or one verb, under the given name, below its parent. `context`
// must outlive the command line.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "client/cli/context.h"

namespace selfcal::client {

// Commands for recordings; without OpenCV they say that they are missing.
void AddCalibrate(CLI::App* app, Context* context);
void AddTrack(CLI::App* app, Context* context);
void AddRigCommands(CLI::App* app, Context* context);
void AddSegmentCommands(CLI::App* app, Context* context);
void AddSessionCommands(CLI::App* app, Context* context);
void AddTableCommands(CLI::App* app, Context* context);
void AddRunCommands(CLI::App* app, Context* context);
void AddCalibrationCommands(CLI::App* app, Context* context);
void AddCohortCommands(CLI::App* app, Context* context);
void AddEstimateCommands(CLI::App* app, Context* context);
void AddInstructionCommands(CLI::App* app, Context* context);
void AddEventCommands(CLI::App* app, Context* context);
void AddDaemonCommands(CLI::App* app, Context* context);
void AddCompletionCommand(CLI::App* app, Context* context);

// Verbs of rig.
void AddRigCreation(CLI::App* rig, Context* context);
void AddImuPresets(CLI::App* rig, Context* context);
void AddRigUpdate(CLI::App* rig, Context* context);
void AddRigDeletion(CLI::App* rig, Context* context);
void AddAttention(CLI::App* rig, Context* context);
CLI::App* AddCoach(CLI::App* parent, const std::string& name, Context* context);
CLI::App* AddVerify(CLI::App* parent,
                    const std::string& name,
                    Context* context);
// Verbs of segment.
void AddSegmentDetails(CLI::App* segments, Context* context);
void AddSegmentExport(CLI::App* segments, Context* context);
CLI::App* AddImport(CLI::App* parent,
                    const std::string& name,
                    Context* context);
CLI::App* AddPreflight(CLI::App* parent,
                       const std::string& name,
                       Context* context);
// The verb of table.
CLI::App* AddTableShow(CLI::App* parent,
                       const std::string& name,
                       Context* context);
// Verbs of run.
CLI::App* AddRunStart(CLI::App* parent,
                      const std::string& name,
                      Context* context);
// Verbs of calibration.
void AddCalibrationRollback(CLI::App* calibrations, Context* context);
void AddCalibrationExport(CLI::App* calibrations, Context* context);
CLI::App* AddCalibrationReport(CLI::App* parent,
                               const std::string& name,
                               Context* context);
// A verb of cohort.
void AddCohortApply(CLI::App* cohorts, Context* context);
// The verb of event.
CLI::App* AddEventList(CLI::App* parent,
                       const std::string& name,
                       Context* context);
// Verbs of daemon.
CLI::App* AddTop(CLI::App* parent, const std::string& name, Context* context);
CLI::App* AddDoctor(CLI::App* parent,
                    const std::string& name,
                    Context* context);
CLI::App* AddBackup(CLI::App* parent,
                    const std::string& name,
                    Context* context);
CLI::App* AddRestore(CLI::App* parent,
                     const std::string& name,
                     Context* context);

// Parses and runs the command line; returns the exit code.
int RunCommandLine(int argc, const char* const* argv);

}  // namespace selfcal::client
