// What is installed beside the daemon: the unit, its user and folders, and the
// image. Where a tool is not installed the test is skipped.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <regex>
#include <sstream>
#include <string>

#include "test/support/files.h"
#include "test/support/temp_folder.h"

namespace selfcal::server {
namespace {

using ::testing::HasSubstr;

constexpr double kMaxExposure = 1.5;

std::string Output(const std::string& command) {
  FILE* const pipe = popen((command + " 2>&1").c_str(), "r");
  std::string output;
  char buffer[4096];
  for (std::size_t n = 0; (n = fread(buffer, 1, sizeof(buffer), pipe)) > 0;) {
    output.append(buffer, n);
  }
  pclose(pipe);
  return output;
}

bool Has(const std::string& tool) {
  return std::system(("command -v " + tool + " >/dev/null").c_str()) == 0;
}

std::string Deployed(const std::string& name) {
  return std::string(SELFCAL_DEPLOY) + "/" + name;
}

TEST(Unit, IsHardened) {
  if (!Has("systemd-analyze")) GTEST_SKIP() << "no systemd-analyze";
  const std::string report = Output("systemd-analyze security --offline=true " +
                                    Deployed("systemd/selfcald.service"));
  std::smatch match;
  ASSERT_TRUE(std::regex_search(
      report, match, std::regex("exposure level[^:]*: ([0-9.]+)")))
      << report;
  RecordProperty("exposure", match[1].str());
  EXPECT_LE(std::stod(match[1]), kMaxExposure);
}

TEST(Unit, HasNoMistake) {
  if (!Has("systemd-analyze")) GTEST_SKIP() << "no systemd-analyze";
  const TempFolder folder;
  std::string unit = ReadBytes(Deployed("systemd/selfcald.service"));
  const std::string program = "/usr/bin/selfcald";
  ASSERT_THAT(unit, HasSubstr("ExecStart=" + program));
  // verify looks whether the program is there.
  unit.replace(unit.find(program), program.size(), SELFCALD_PATH);
  const std::string file = folder.File("selfcald.service");
  WriteBytes(file, unit);
  EXPECT_EQ(Output("systemd-analyze --man=no verify " + file), "");
}

TEST(Unit, UserAndFoldersAreMade) {
  if (!Has("systemd-sysusers") || !Has("systemd-tmpfiles")) {
    GTEST_SKIP() << "no systemd-sysusers or systemd-tmpfiles";
  }
  const TempFolder folder;
  const std::string root = folder.path();
  std::filesystem::create_directories(root + "/etc");
  Output("systemd-sysusers --root=" + root + " " +
         Deployed("systemd/selfcal.sysusers.conf"));
  EXPECT_THAT(ReadBytes(root + "/etc/passwd"), HasSubstr("selfcal:x:"));
  EXPECT_THAT(ReadBytes(root + "/etc/group"), HasSubstr("selfcal:x:"));
  if (geteuid() == 0) {
    Output("systemd-tmpfiles --create --root=" + root + " " +
           Deployed("systemd/selfcal.tmpfiles.conf"));
    for (const std::string made :
         {"/etc/selfcal", "/var/lib/selfcal", "/run/selfcal"}) {
      EXPECT_TRUE(std::filesystem::is_directory(root + made)) << made;
      EXPECT_EQ(std::filesystem::status(root + made).permissions() &
                    std::filesystem::perms::others_all,
                std::filesystem::perms::none)
          << made;
    }
  }
}

// Everything in the image comes from the packages, whose libraries and licences
// are those of the packages.
TEST(Image, IsMadeOfThePackagesAlone) {
  std::istringstream lines(ReadBytes(Deployed("Containerfile")));
  std::string image;  // of the last stage
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with("FROM ")) image.clear();
    image += line + "\n";
  }
  EXPECT_THAT(image, HasSubstr("FROM docker.io/library/debian:12-slim\n"));
  EXPECT_THAT(image,
              HasSubstr("\nCOPY --from=build /packages/selfcald_*.deb "
                        "/packages/selfcal_*.deb /packages/\n"));
  EXPECT_EQ(image.find("COPY"), image.rfind("COPY"));
  EXPECT_THAT(image, HasSubstr("\nHEALTHCHECK "));
  // Not systemd itself: the packages accept these in its place.
  const std::string packaging = ReadBytes(Deployed("packaging.cmake"));
  for (const std::string tool : {"sysusers", "tmpfiles"}) {
    EXPECT_THAT(image, HasSubstr("systemd-standalone-" + tool));
    EXPECT_THAT(packaging, HasSubstr("systemd | systemd-" + tool));
  }
}

}  // namespace
}  // namespace selfcal::server
