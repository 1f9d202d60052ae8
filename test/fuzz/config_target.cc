#include <fstream>
#include <string>

#include "server/daemon/config_file.h"
#include "test/fuzz/fuzz_folder.h"
#include "test/fuzz/targets.h"

namespace selfcal {

void FuzzConfig(std::string_view bytes) {
  const std::string path = (FuzzFolder() / "selfcald.toml").string();
  std::ofstream(path, std::ios::binary) << bytes;
  server::DaemonOptions options;
  const absl::Status status = server::ApplyConfigFile(path, &options);
  FuzzCheck(status.ok() || std::string(status.message()).find(path + ":") == 0,
            "a refusal names the file and the line");
}

}  // namespace selfcal
