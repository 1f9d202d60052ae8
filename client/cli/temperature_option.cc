#include "client/cli/temperature_option.h"

#include "core/model/segment.h"

namespace selfcal::client {

void AddTemperature(CLI::App* command,
                    const std::string& what,
                    std::optional<double>* temperature_c) {
  const SegmentLimits limits;
  command
      ->add_option("--temperature", *temperature_c, what + " [degrees Celsius]")
      ->check(CLI::Range(limits.min_temperature_c, limits.max_temperature_c));
}

}  // namespace selfcal::client
