#include "server/daemon/service_manager.h"

#include <gtest/gtest.h>
#include <stdlib.h>

#include "test/server/daemon/notify_socket.h"
#include "test/support/temp_folder.h"

namespace selfcal::server {
namespace {

TEST(ServiceManager, IsToldOfEachTurn) {
  const TempFolder folder;
  const std::string path = folder.File("socket");
  NotifySocket manager(path);
  setenv("NOTIFY_SOCKET", path.c_str(), 1);
  NotifyStatus("migrating");
  EXPECT_EQ(manager.Next(), "STATUS=migrating");
  NotifyReady();
  EXPECT_TRUE(manager.Hears("READY=1"));
  NotifyAlive();
  EXPECT_EQ(manager.Next(), "WATCHDOG=1");
  NotifyStopping();
  EXPECT_TRUE(manager.Hears("STOPPING=1"));
  unsetenv("NOTIFY_SOCKET");
  NotifyReady();  // to nobody
}

TEST(ServiceManager, WatchdogIsFedTwiceWithinItsLimit) {
  EXPECT_EQ(WatchdogInterval(), std::nullopt);
  setenv("WATCHDOG_USEC", "10000000", 1);
  EXPECT_EQ(WatchdogInterval(), std::chrono::seconds(5));
  setenv("WATCHDOG_PID", "1", 1);  // meant for another process
  EXPECT_EQ(WatchdogInterval(), std::nullopt);
  unsetenv("WATCHDOG_USEC");
  unsetenv("WATCHDOG_PID");
}

}  // namespace
}  // namespace selfcal::server
