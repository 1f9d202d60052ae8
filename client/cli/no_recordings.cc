// Stands in for the commands that read recordings, in a build without OpenCV.
#include <string>

#include "client/cli/commands.h"

namespace selfcal::client {
namespace {

void AddMissing(CLI::App* app, const std::string& name, Context* context) {
  CLI::App* command = app->add_subcommand(
      name, "Not in this build: it was made without OpenCV");
  command->allow_extras();
  command->callback([context, name] {
    context->command = [name] {
      PrintError("this selfcal was built without OpenCV, which '" + name +
                 "' needs; install libopencv-dev and build it again");
      return kUsage;
    };
  });
}

}  // namespace

void AddCalibrate(CLI::App* app, Context* context) {
  AddMissing(app, "calibrate", context);
}

void AddTrack(CLI::App* app, Context* context) {
  AddMissing(app, "track", context);
}

}  // namespace selfcal::client
