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

// Returns the completions of the last word by bash. `selfcal` is a function
// with this body.
std::vector<std::string> Offered(const std::vector<std::string>& words,
                                 const std::string& answer = "false") {
  const TempFolder folder;
  const std::string script = folder.File("script");
  {
    std::ofstream file(script);
    file << Selfcal({"completion", "bash"}).out << "selfcal() { " << answer
         << "; }\nCOMP_WORDS=(selfcal";
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
  EXPECT_THAT(Offered({"seg"}), testing::ElementsAre("segment"));
  EXPECT_THAT(Offered({"run", "ca"}), testing::ElementsAre("cancel"));
  EXPECT_THAT(Offered({"calibrations", ""}),
              testing::IsSupersetOf({"list", "show", "compare", "activate"}));
}

TEST(Completion, OffersTheFlagsOfACommandAndTheGlobalOnes) {
  EXPECT_THAT(Offered({"segment", "list", "device", "--fi"}),
              testing::ElementsAre("--filter"));
  EXPECT_THAT(Offered({"--json", "segments", "list", "--tar"}),
              testing::ElementsAre("--target"));
}

TEST(Completion, OffersTheRigsOfTheDaemon) {
  const std::string rigs = "printf 'tablet-1\\ntablet-2\\nphone\\n'";
  EXPECT_THAT(Offered({"rig", "show", "tab"}, rigs),
              testing::ElementsAre("tablet-1", "tablet-2"));
  EXPECT_THAT(Offered({"segments", "list", "pho"}, rigs),
              testing::ElementsAre("phone"));
  EXPECT_THAT(Offered({"segment", "preflight", "--device", "pho"}, rigs),
              testing::ElementsAre("phone"));
  EXPECT_THAT(Offered({"rig", "show", "phone", "tab"}, rigs),
              testing::ElementsAre(""))
      << "a second argument is no rig";
  EXPECT_THAT(Offered({"rig", "list", "tab"}, rigs), testing::ElementsAre(""));
  // The connection is that of the line.
  EXPECT_THAT(
      Offered({"--target", "unix:/x", "rig", "show", "unix"}, R"(echo "$@")"),
      testing::ElementsAre("unix:/x"));
  EXPECT_THAT(Offered({"rig", "show", "tab"}), testing::ElementsAre(""));
}

TEST_F(Commands, RigNamesForCompletionComeFromTheDaemonOrNotAtAll) {
  daemon_.rigs = {ToProto(ARig("phone")), ToProto(ARig("tablet-1"))};
  const Outcome names = Selfcal({"completion", "rigs"});
  EXPECT_EQ(names.code, 0);
  EXPECT_EQ(names.out, "phone\ntablet-1\n");
  const Outcome away = client::Selfcal(
      {"completion", "rigs", "--target", "unix:/nowhere/socket"});
  EXPECT_EQ(away.code, 0);
  EXPECT_EQ(away.out, "");
  EXPECT_EQ(away.err, "");
}

TEST(Completion, OtherShellsKnowTheSameCommands) {
  const std::string zsh = Selfcal({"completion", "zsh"}).out;
  EXPECT_THAT(zsh, HasSubstr(Selfcal({"completion", "bash"}).out));
  // As a file in zsh's fpath.
  EXPECT_THAT(zsh, testing::StartsWith("#compdef selfcal\n"));
  const Outcome fish = Selfcal({"completion", "fish"});
  EXPECT_THAT(fish.out,
              HasSubstr("complete -c selfcal -n '__fish_seen_subcommand_from "
                        "run' -a cancel "));
  EXPECT_THAT(fish.out,
              HasSubstr("-n '__fish_seen_subcommand_from segment; and "
                        "__fish_seen_subcommand_from list' -l filter "));
  EXPECT_EQ(Selfcal({"completion", "csh"}).code, 2);
}

}  // namespace
}  // namespace selfcal::client
