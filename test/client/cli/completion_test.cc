// The scripts for shells, run where there is such a shell.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cstdio>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "test/client/cli/commands_fixture.h"
#include "test/support/temp_folder.h"

namespace selfcal::client {
namespace {

using testing::HasSubstr;

// What bash offers for the last of the words, one a line.
std::vector<std::string> Offered(const std::vector<std::string>& words) {
  const TempFolder folder;
  const std::string script = folder.File("script");
  {
    std::ofstream file(script);
    file << Selfcal({"completion", "bash"}).out << "COMP_WORDS=(selfcal";
    for (const std::string& word : words) file << " '" << word << "'";
    file << ")\nCOMP_CWORD=" << words.size()
         << "\n_selfcal\nprintf '%s\\n' \"${COMPREPLY[@]}\"\n";
  }
  const auto close = [](FILE* file) { pclose(file); };
  const std::unique_ptr<FILE, decltype(close)> shell(
      popen(("bash " + script + " 2>&1").c_str(), "r"), close);
  std::vector<std::string> offered;
  std::array<char, 256> line{};
  while (fgets(line.data(), line.size(), shell.get()) != nullptr) {
    offered.emplace_back(line.data());
    offered.back().pop_back();
  }
  return offered;
}

TEST(Completion, OffersCommandsAndWhatIsBelowThem) {
  EXPECT_THAT(Offered({"seg"}), testing::ElementsAre("segments"));
  EXPECT_THAT(Offered({"runs", "ca"}), testing::ElementsAre("cancel"));
  EXPECT_THAT(Offered({"calibrations", ""}),
              testing::IsSupersetOf({"list", "show", "diff", "activate"}));
}

TEST(Completion, OffersTheFlagsOfACommandAndTheGlobalOnes) {
  EXPECT_THAT(Offered({"segments", "list", "device", "--fi"}),
              testing::ElementsAre("--filter"));
  EXPECT_THAT(Offered({"--json", "segments", "list", "--tar"}),
              testing::ElementsAre("--target"));
}

TEST(Completion, OtherShellsKnowTheSameCommands) {
  const std::string zsh = Selfcal({"completion", "zsh"}).out;
  EXPECT_THAT(zsh, HasSubstr(Selfcal({"completion", "bash"}).out));
  // As a file in zsh's fpath.
  EXPECT_THAT(zsh, testing::StartsWith("#compdef selfcal\n"));
  const Outcome fish = Selfcal({"completion", "fish"});
  EXPECT_THAT(fish.out,
              HasSubstr("complete -c selfcal -n '__fish_seen_subcommand_from "
                        "runs' -a cancel "));
  EXPECT_THAT(fish.out,
              HasSubstr("-n '__fish_seen_subcommand_from segments; and "
                        "__fish_seen_subcommand_from list' -l filter "));
  EXPECT_EQ(Selfcal({"completion", "csh"}).code, 2);
}

}  // namespace
}  // namespace selfcal::client
