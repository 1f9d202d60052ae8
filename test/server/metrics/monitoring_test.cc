// The alerts of deploy/monitoring against the documents that name their series
// and say what to do.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <iterator>
#include <regex>
#include <set>
#include <string>

namespace selfcal::server {
namespace {

using ::testing::HasSubstr;

std::string Read(const std::string& path) {
  std::ifstream file(std::string(SELFCAL_ROOT) + "/" + path);
  return {std::istreambuf_iterator<char>(file), {}};
}

std::set<std::string> Matches(const std::string& text,
                              const std::string& pattern) {
  const std::regex expression(pattern);
  std::set<std::string> found;
  for (std::sregex_iterator at(text.begin(), text.end(), expression), end;
       at != end;
       ++at) {
    found.insert(at->str(1));
  }
  return found;
}

TEST(Monitoring, SeriesOfAClientAreThoseOfTheDocument) {
  const std::set<std::string> used = Matches(
      Read("deploy/monitoring/client_alerts.yml"), "selfcal_client_([a-z_]+)");
  EXPECT_GE(used.size(), 6u);
  const std::string document = Read("docs/operations.md");
  for (const std::string& name : used) {
    EXPECT_THAT(document, HasSubstr("line(\"" + name + "\""));
  }
}

TEST(Monitoring, TheOperatorIsToldWhatToDoAboutEachAlert) {
  const std::string alerts = Read("deploy/monitoring/alerts.yml") +
                             Read("deploy/monitoring/client_alerts.yml");
  const std::set<std::string> names = Matches(alerts, "alert: ([A-Za-z]+)");
  EXPECT_GE(names.size(), 17u);
  const std::string document = Read("docs/tutorials/operator.md");
  for (const std::string& name : names) {
    EXPECT_THAT(document, HasSubstr("`" + name + "`"));
  }
}

}  // namespace
}  // namespace selfcal::server
