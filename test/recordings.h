// Where the real recordings lie: the folder of the environment variable
// SELFCAL_TEST_DATA, or else the one that the build was told.
#pragma once

#include <cstdlib>
#include <filesystem>
#include <string>

namespace selfcal {

// Path of a recording, empty if it is not there.
inline std::string Recording(const std::string& name) {
  const char* folder = std::getenv("SELFCAL_TEST_DATA");
  const std::string path =
      std::string(folder ? folder : SELFCAL_DATA_DIR) + "/" + name;
  return std::filesystem::exists(path) ? path : std::string();
}

}  // namespace selfcal

// For tests that are about a recording: without it there is nothing to test.
#define SELFCAL_NEED_RECORDING(variable, name)                       \
  const std::string variable = ::selfcal::Recording(name);           \
  if (variable.empty()) {                                            \
    GTEST_SKIP() << "recording " << (name) << " is not beside the "  \
                 << "checkout; set SELFCAL_TEST_DATA to its folder"; \
  }
