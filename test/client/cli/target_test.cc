#include "client/cli/target.h"

#include <gtest/gtest.h>

#include <string>

namespace selfcal::client {
namespace {

TEST(Resolve, UsesTheFilesForAPortAlone) {
  const auto port = Resolve({"host:7447", "ca", "cert", "key"});
  ASSERT_TRUE(port.ok());
  EXPECT_EQ(port->target, "host:7447");
  EXPECT_EQ(port->ca_file, "ca");
  EXPECT_EQ(port->certificate_file, "cert");
  EXPECT_EQ(port->key_file, "key");
  for (const std::string address : {"unix:/a", "unix-abstract:a"}) {
    const auto socket = Resolve({address, "ca", "cert", "key"});
    ASSERT_TRUE(socket.ok());
    EXPECT_EQ(socket->target, address);
    EXPECT_EQ(socket->ca_file + socket->certificate_file + socket->key_file,
              "");
  }
}

TEST(Resolve, GoesWithoutTlsOnlyIfItIsAskedForByName) {
  const auto insecure = Resolve({"insecure:host:7447"});
  ASSERT_TRUE(insecure.ok());
  EXPECT_EQ(insecure->target, "host:7447");
  EXPECT_EQ(insecure->ca_file, "");
  for (const Target& target : {Target{"host:7447"},
                               Target{"dns:///host:7447"},
                               Target{"[::1]:7447", "ca"},
                               Target{"host:7447", "ca", "cert"},
                               Target{"host:7447", "ca", "", "key"},
                               Target{"host:7447", "", "cert", "key"}}) {
    const auto refused = Resolve(target);
    EXPECT_TRUE(absl::IsInvalidArgument(refused.status())) << target.address;
    EXPECT_NE(std::string(refused.status().message())
                  .find("insecure:" + target.address),
              std::string::npos);
  }
}

}  // namespace
}  // namespace selfcal::client
