// The exception of this module, which does not leave it: ImportRig and
// ExportRig convert it to a status.
#pragma once

#include <stdexcept>

namespace selfcal::client {

struct FormatError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

}  // namespace selfcal::client
