// Writes the contract of this program as released/contract.txt keeps it: to be
// run at a release, when its difference to the file must be additions alone.
#include <iostream>

#include "test/proto/contract_lines.h"

int main() {
  for (const auto& line : selfcal::ContractLines(selfcal::CompiledContract())) {
    std::cout << line << "\n";
  }
}
