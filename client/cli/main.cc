#include "client/cli/commands.h"

int main(int argc, char** argv) {
  return selfcal::client::RunCommandLine(argc, argv);
}
