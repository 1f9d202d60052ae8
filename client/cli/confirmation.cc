#include "client/cli/confirmation.h"

#include <iostream>

namespace selfcal::client {

bool Confirmed(const std::string& question) {
  std::cerr << question << " [y/N] " << std::flush;
  std::string answer;
  std::getline(std::cin, answer);
  return answer == "y" || answer == "Y" || answer == "yes";
}

}  // namespace selfcal::client
