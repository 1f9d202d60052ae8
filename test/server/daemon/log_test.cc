#include "server/daemon/log.h"

#include <gtest/gtest.h>
#include <spdlog/spdlog.h>

#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>

#include "test/support/temp_folder.h"

namespace selfcal::server {
namespace {

// Whether the log of this process, which goes to the file, is as it must be.
bool LogsJson(const std::string& file) {
  if (std::freopen(file.c_str(), "w", stderr) == nullptr) return false;
  SetUpLog("info", "json");
  spdlog::warn("a \"quoted\" text\nof two lines and no UTF-8: \xff");
  spdlog::debug("not shown");
  SetLogLevel("debug");
  spdlog::debug("shown");
  std::ifstream log(file);
  std::string first, second, none;
  std::getline(log, first);
  std::getline(log, second);
  if (std::getline(log, none)) return false;
  const auto warning = nlohmann::json::parse(first);
  return warning["level"] == "warning" &&
         warning["message"].get<std::string>().starts_with("a \"quoted\"") &&
         warning["time"].get<std::string>().size() == 24 &&
         nlohmann::json::parse(second)["message"] == "shown";
}

// In a process of its own: the log is global.
TEST(LogDeathTest, JsonIsAnObjectOnEachLineWhateverIsLogged) {
  const TempFolder folder;
  const std::string file = folder.File("log");
  EXPECT_EXIT(
      std::_Exit(LogsJson(file) ? 3 : 4), ::testing::ExitedWithCode(3), "");
}

TEST(LogDeathTest, TextShowsLevelAndMessage) {
  EXPECT_EXIT(
      {
        SetUpLog("warning", "text");
        spdlog::info("not shown");
        spdlog::warn("shown");
        std::_Exit(3);
      },
      ::testing::ExitedWithCode(3),
      "^[0-9T:.-]+Z warning shown\n$");
}

TEST(LogDeathTest, AMessageIsOneLineThatControlsNothing) {
  EXPECT_EXIT(
      {
        SetUpLog("warning", "text");
        spdlog::warn("of a caller: {}", "x\n2026-01-01 error forged\033[2J");
        std::_Exit(3);
      },
      ::testing::ExitedWithCode(3),
      "^[0-9T:.-]+Z warning of a caller: x.2026-01-01 error forged.\\[2J\n$");
}

}  // namespace
}  // namespace selfcal::server
