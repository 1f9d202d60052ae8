// Thrown inside this room only; ImportRig and ExportRig turn it into a status.
#pragma once

#include <stdexcept>

namespace selfcal::client {

struct FormatError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

}  // namespace selfcal::client
