#include "server/access/loopback_host.h"

#include <gtest/gtest.h>

namespace selfcal::server {
namespace {

TEST(IsLoopbackHost, TakesTheNamesOfTheLoopbackAlone) {
  for (const char* host : {"127.0.0.1",
                           "127.0.0.1:7448",
                           "localhost",
                           "localhost:80",
                           "[::1]",
                           "[::1]:7448"}) {
    EXPECT_TRUE(IsLoopbackHost(host)) << host;
  }
  for (const char* host : {"",
                           "evil.example",
                           "127.0.0.1.evil.example:80",
                           "[::1].evil.example",
                           "[::1]:80.evil.example",
                           "localhost:evil.example",
                           "[::1",
                           "::1",
                           "[]",
                           ":80"}) {
    EXPECT_FALSE(IsLoopbackHost(host)) << host;
  }
}

}  // namespace
}  // namespace selfcal::server
