// Where targets put what is read from files.
#pragma once

#include <filesystem>

namespace selfcal {

// One for a process, made by the first call, removed at its end.
const std::filesystem::path& FuzzFolder();

}  // namespace selfcal
