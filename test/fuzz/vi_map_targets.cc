#include <zlib.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "client/formats/format.h"
#include "client/import/vi_map.h"
#include "test/fuzz/fuzz_folder.h"
#include "test/fuzz/seeds.h"
#include "test/fuzz/targets.h"

namespace selfcal {
namespace {

namespace fs = std::filesystem;

// A map that lacks its part.
const fs::path& MapFolder() {
  static const fs::path folder = [] {
    fs::path path = FuzzFolder() / "map";
    fs::create_directories(path / "vi_map");
    std::ofstream(path / "vi_map/vi_map_metadata")
        << "files { file_type: 0 path: \"part\" }";
    std::ofstream(path / "vi_map/sensors.yaml") << FuzzSensorsText();
    return path;
  }();
  return folder;
}

}  // namespace

void FuzzViMap(std::string_view bytes) {
  const std::string part = (MapFolder() / "vi_map/part").string();
  gzFile file = gzopen(part.c_str(), "wb1");
  FuzzCheck(file != nullptr, "the temporary folder can be written");
  gzwrite(file, bytes.data(), static_cast<unsigned>(bytes.size()));
  gzclose(file);
  const auto recording = client::ReadViMap(MapFolder().string(), {});
  if (!recording.ok()) {
    FuzzCheck(!recording.status().message().empty(), "a refusal says why");
    return;
  }
  client::BuildSegments(*recording, {.session = recording->session});
}

void FuzzSensors(std::string_view bytes) {
  const auto rig =
      client::ImportRig("maplab", {{"sensors.yaml", std::string(bytes)}}, {});
  FuzzCheck(rig.ok() || !rig.status().message().empty(), "a refusal says why");
}

}  // namespace selfcal
