// The commands over mutual TLS.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "test/client/cli/commands_fixture.h"
#include "test/recordings.h"
#include "test/support/certificates.h"

namespace selfcal::client {
namespace {

using ::testing::HasSubstr;

class TlsCommands : public ::testing::Test {
 protected:
  TlsCommands() : daemon_(certificates_.Server()) {
    certificates_.Add("operator", "ca", "URI:selfcal://role/administer");
    daemon_.rigs.emplace_back().set_name("rigs/device");
  }

  std::vector<std::string> As(const std::string& name,
                              const std::string& authority = "ca") const {
    return {"--ca",
            certificates_.Pem(authority),
            "--cert",
            certificates_.Pem(name),
            "--key",
            certificates_.Key(name)};
  }

  int Selfcal(std::vector<std::string> arguments,
              const std::vector<std::string>& more = {}) {
    arguments.insert(arguments.end(), {"--target", target_});
    arguments.insert(arguments.end(), more.begin(), more.end());
    Outcome outcome = client::Selfcal(arguments);
    out_ = std::move(outcome.out);
    err_ = std::move(outcome.err);
    return outcome.code;
  }

  Certificates certificates_;
  CannedDaemon daemon_;
  std::string target_ = daemon_.target;
  std::string out_;
  std::string err_;
};

TEST_F(TlsCommands, WorkWithACertificateOfTheAuthority) {
  EXPECT_EQ(Selfcal({"rig", "list"}, As("operator")), 0) << err_;
  EXPECT_THAT(out_, HasSubstr("device"));
}

TEST_F(TlsCommands, TakeTheFilesFromTheEnvironment) {
  setenv("SELFCAL_CA", certificates_.Pem("ca").c_str(), 1);
  setenv("SELFCAL_CERT", certificates_.Pem("operator").c_str(), 1);
  setenv("SELFCAL_KEY", certificates_.Key("operator").c_str(), 1);
  EXPECT_EQ(Selfcal({"rig", "list"}), 0) << err_;
  for (const char* name : {"SELFCAL_CA", "SELFCAL_CERT", "SELFCAL_KEY"}) {
    unsetenv(name);
  }
  EXPECT_THAT(out_, HasSubstr("device"));
}

TEST_F(TlsCommands, AreNotConnectedWithTheWrongOnes) {
  certificates_.AddAuthority("other");
  certificates_.Add("stranger", "other", "URI:selfcal://role/administer");
  EXPECT_EQ(Selfcal({"rig", "list"}, As("stranger")), 3);
  EXPECT_EQ(Selfcal({"rig", "list"}, As("operator", "other")), 3);
  EXPECT_EQ(out_, "");
  target_ = "insecure:" + daemon_.target;
  EXPECT_EQ(Selfcal({"rig", "list"}, As("operator")), 3);
}

TEST_F(TlsCommands, SayWhatIsMissing) {
  EXPECT_EQ(Selfcal({"rig", "list"}), 2);
  EXPECT_THAT(err_, HasSubstr("insecure:" + target_));
  auto files = As("operator");
  files[1] = "/nonexistent/ca.pem";
  EXPECT_EQ(Selfcal({"rig", "list"}, files), 2);
  EXPECT_THAT(err_, HasSubstr("/nonexistent/ca.pem"));
}

// A stream of the library's, not a call on the channel of the others.
TEST_F(TlsCommands, ImportARecording) {
  SELFCAL_NEED_RECORDING(map, "tango_handheld");
  EXPECT_EQ(Selfcal({"import", "device", map}, As("operator")), 0) << err_;
  EXPECT_THAT(out_, HasSubstr("\t13\tSTORED\n"));
}

TEST(InsecureCommands, WorkOnAPortIfItIsAskedForByName) {
  CannedDaemon daemon(grpc::InsecureServerCredentials());
  daemon.rigs.emplace_back().set_name("rigs/device");
  const std::string target = "insecure:" + daemon.target;
  const Outcome outcome = Selfcal({"rig", "list", "--target", target});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("device"));
}

}  // namespace
}  // namespace selfcal::client
