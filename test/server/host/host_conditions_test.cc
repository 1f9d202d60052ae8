#include "server/host/host_conditions.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <thread>

#include "test/support/temp_folder.h"

namespace selfcal::server {
namespace {

namespace fs = std::filesystem;

using ::testing::HasSubstr;

class HostConditionsTest : public ::testing::Test {
 protected:
  HostConditionsTest() {
    files_.power_supplies = folder_.File("power");
    files_.load = folder_.File("loadavg");
  }

  void Write(const std::string& supply,
             const std::string& file,
             const std::string& text) {
    fs::create_directories(files_.power_supplies / supply);
    std::ofstream(files_.power_supplies / supply / file) << text << '\n';
  }
  // For each processor.
  void SetLoad(double load) {
    std::ofstream(files_.load)
        << load * std::max(1u, std::thread::hardware_concurrency())
        << " 0.50 0.40 2/345 6789\n";
  }
  std::string Reason() {
    return MakeHostConditions(limits_, files_)->DeferReason();
  }

  const TempFolder folder_;
  HostFiles files_;
  HostLimits limits_;
};

TEST_F(HostConditionsTest, WithoutLimitsEveryTimeIsOne) {
  Write("BAT0", "type", "Battery");
  SetLoad(99);
  EXPECT_EQ(Reason(), "");
}

TEST_F(HostConditionsTest, BatteryHoldsBackUntilSomethingElseIsOnline) {
  limits_.only_on_external_power = true;
  EXPECT_EQ(Reason(), "");  // no such folder: no battery
  Write("hid-mouse", "type", "Battery");
  Write("hid-mouse", "scope", "Device");
  EXPECT_EQ(Reason(), "");
  Write("BAT0", "type", "Battery");
  EXPECT_THAT(Reason(), HasSubstr("battery"));
  Write("AC", "type", "Mains");
  Write("AC", "online", "0");
  EXPECT_THAT(Reason(), HasSubstr("battery"));
  Write("AC", "online", "1");
  EXPECT_EQ(Reason(), "");
}

TEST_F(HostConditionsTest, LoadHoldsBackWhereItReachesTheLimit) {
  limits_.max_load = 0.5;
  EXPECT_THAT(Reason(), HasSubstr("cannot be read"));
  SetLoad(0.4);
  EXPECT_EQ(Reason(), "");
  SetLoad(0.6);
  EXPECT_THAT(Reason(), HasSubstr("0.5"));
}

}  // namespace
}  // namespace selfcal::server
