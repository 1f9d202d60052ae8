#include "server/host/host_conditions.h"

#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <string>
#include <system_error>
#include <thread>

namespace selfcal::server {
namespace {

namespace fs = std::filesystem;

std::string FirstWord(const fs::path& file) {
  std::ifstream stream(file);
  std::string word;
  stream >> word;
  return word;
}

// True if the machine runs on its battery. A machine without a battery is
// always on external power.
bool OnBattery(const fs::path& supplies) {
  bool has_battery = false;
  std::error_code error;
  for (const auto& supply : fs::directory_iterator(supplies, error)) {
    if (FirstWord(supply.path() / "type") == "Battery") {
      // The battery of a peripheral, e.g. a mouse, is ignored.
      has_battery |= FirstWord(supply.path() / "scope") != "Device";
    } else if (FirstWord(supply.path() / "online") == "1") {
      return false;
    }
  }
  return has_battery;
}

class HostConditions : public Conditions {
 public:
  HostConditions(const HostLimits& limits, const HostFiles& files)
      : limits_(limits), files_(files) {}

  std::string DeferReason() override {
    if (limits_.only_on_external_power && OnBattery(files_.power_supplies)) {
      return "the machine runs on its battery";
    }
    return limits_.max_load > 0 ? LoadReason() : "";
  }

 private:
  std::string LoadReason() const {
    std::ifstream stream(files_.load);
    double load = 0;
    if (!(stream >> load)) {
      return fmt::format("the load cannot be read from {}",
                         files_.load.string());
    }
    const double processors = std::max(1u, std::thread::hardware_concurrency());
    if (load / processors < limits_.max_load) {
      return "";
    }
    return fmt::format("the load is {:g} per processor or more",
                       limits_.max_load);
  }

  const HostLimits limits_;
  const HostFiles files_;
};

}  // namespace

std::unique_ptr<Conditions> MakeHostConditions(const HostLimits& limits,
                                               const HostFiles& files) {
  return std::make_unique<HostConditions>(limits, files);
}

}  // namespace selfcal::server
