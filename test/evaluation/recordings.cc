#include "test/evaluation/recordings.h"

#include <stdexcept>
#include <utility>

#include "client/demo/device.h"
#include "test/recordings.h"

namespace selfcal {
namespace {

// Throws where a recording that is there cannot be read.
std::optional<RecordedDevice> Read(const std::string& name,
                                   const std::vector<std::string>& parts,
                                   const client::RecordingOptions& options) {
  const std::string path = Recording(name);
  if (path.empty()) return std::nullopt;
  std::vector<std::string> folders;
  for (const std::string& part : parts) folders.push_back(path + part);
  auto device = client::ReadDevice(folders, options);
  if (!device.ok()) {
    throw std::runtime_error(name + ": " + device.status().ToString());
  }
  return RecordedDevice{
      name, std::move(device->rig), std::move(device->segments)};
}

}  // namespace

std::optional<RecordedDevice> ReadTango() {
  std::optional<RecordedDevice> tango =
      Read("tango_handheld", {""}, {40, 5e-5, 2e-3});
  if (tango) tango->rig.pixel_sigma_px = 0.8;
  return tango;
}

std::optional<RecordedDevice> ReadEuroc(int keyframes) {
  return Read("euroc_v1_01", {""}, {keyframes, {}, {}});
}

std::optional<RecordedDevice> ReadRoom() {
  return Read("equidistant_room", {""}, {20, {}, {}});
}

std::vector<RecordedDevice> ReadRecordings() {
  std::vector<RecordedDevice> all;
  const auto add = [&](std::optional<RecordedDevice> device) {
    if (device) all.push_back(std::move(*device));
  };
  add(ReadTango());
  add(ReadEuroc(20));
  add(ReadRoom());
  return all;
}

}  // namespace selfcal
