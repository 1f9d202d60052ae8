// Writes the seeds of every target into FOLDER/<target>/.
#include <cstdio>
#include <exception>
#include <filesystem>
#include <fstream>

#include "test/fuzz/seeds.h"

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: %s FOLDER\n", argv[0]);
    return 2;
  }
  try {
    for (const selfcal::FuzzSeed& seed : selfcal::FuzzSeeds()) {
      const auto folder = std::filesystem::path(argv[1]) / seed.target;
      std::filesystem::create_directories(folder);
      std::ofstream file(folder / seed.name, std::ios::binary);
      file.exceptions(std::ios::failbit | std::ios::badbit);
      file << seed.bytes;
    }
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
