#include "core/calibration/chain_thetas.h"

#include <utility>

#include "core/model/temperature.h"

namespace selfcal {

ChainThetas::ChainThetas(Calibration theta) {
  all_.push_back(std::move(theta));
}

ChainThetas::ChainThetas(const Calibration& theta,
                         const CalibrationProblem& problem) {
  if (!HasSlopes(theta)) {
    all_.push_back(theta);
    return;
  }
  for (const double temperature_c : problem.chain_temperatures_c) {
    all_.push_back(AtTemperature(theta, temperature_c));
    derivatives_.push_back(TemperatureDerivative(theta, temperature_c));
  }
  int chain = -1;
  for (int k = 0; k < static_cast<int>(problem.keyframes.size()); ++k) {
    const auto next = static_cast<std::size_t>(chain + 1);
    if (next < problem.chain_starts.size() && problem.chain_starts[next] == k) {
      ++chain;
    }
    index_.push_back(chain);
  }
}

}  // namespace selfcal
