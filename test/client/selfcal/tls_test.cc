// Mutual TLS of the client, against certificates made on the spot.
#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <sstream>
#include <thread>

#include "client/selfcal/client.h"
#include "test/client/selfcal/fake_daemon.h"
#include "test/client/selfcal/test_folder.h"
#include "test/support/eventually.h"

namespace selfcal::client {
namespace {

constexpr std::chrono::seconds kLong{60};  // for what must happen

std::string ReadAll(const std::string& path) {
  std::ifstream file(path);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

class TlsTest : public ::testing::Test {
 protected:
  TlsTest() {
    MakeAuthority("ca");
    MakeAuthority("other");
    MakeCertificate("ca", "daemon");
    MakeCertificate("ca", "device");
    MakeCertificate("other", "stranger");
    grpc::SslServerCredentialsOptions tls(
        GRPC_SSL_REQUEST_AND_REQUIRE_CLIENT_CERTIFICATE_AND_VERIFY);
    tls.pem_root_certs = ReadAll(Path("ca.pem"));
    tls.pem_key_cert_pairs.push_back(
        {ReadAll(Path("daemon.key")), ReadAll(Path("daemon.pem"))});
    daemon_.StartOnTcp(grpc::SslServerCredentials(tls));
  }

  std::string Path(const std::string& name) const {
    return folder_.path() / name;
  }
  void Run(const std::string& command) {
    const std::string line =
        "cd '" + folder_.path().string() + "' && " + command + " 2>log";
    ASSERT_EQ(std::system(line.c_str()), 0) << ReadAll(Path("log"));
  }
  void MakeAuthority(const std::string& name) {
    Run("openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes "
        "-days 2 -subj /CN=" +
        name + " -keyout " + name + ".key -out " + name + ".pem");
  }
  void MakeCertificate(const std::string& authority, const std::string& name) {
    Run("openssl req -newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes "
        "-subj /CN=" +
        name + " -addext subjectAltName=DNS:localhost -keyout " + name +
        ".key -out " + name + ".csr");
    Run("openssl x509 -req -copy_extensions copy -days 1 -CAcreateserial -in " +
        name + ".csr -CA " + authority + ".pem -CAkey " + authority +
        ".key -out " + name + ".pem");
  }

  ClientOptions Options(const std::string& authority,
                        const std::string& name) const {
    ClientOptions options;
    options.target = daemon_.target();
    options.rig = "device";
    if (!authority.empty()) options.ca_file = Path(authority + ".pem");
    if (!name.empty()) {
      options.certificate_file = Path(name + ".pem");
      options.key_file = Path(name + ".key");
    }
    options.min_backoff = std::chrono::milliseconds(1);
    return options;
  }

  // What a stream with these options comes to say of its connection.
  absl::Status Refusal(const ClientOptions& options) {
    SegmentStream stream(options, nullptr);
    MotionSegment segment;
    segment.key = {"walk", 0};
    EXPECT_TRUE(stream.Send(segment));
    EXPECT_TRUE(Eventually([&] {
      return !stream.connection_status().ok() || stream.statistics().stored > 0;
    }));
    return stream.statistics().stored > 0 ? absl::OkStatus()
                                          : stream.connection_status();
  }

  TestFolder folder_;
  FakeDaemon daemon_;
};

TEST_F(TlsTest, StreamsWithACertificateOfTheAuthority) {
  SegmentStream stream(Options("ca", "device"), nullptr);
  MotionSegment segment;
  segment.key = {"walk", 0};
  ASSERT_TRUE(stream.Send(segment));
  EXPECT_TRUE(stream.Drain(kLong).ok());
  EXPECT_EQ(stream.statistics().stored, 1u);
}

TEST_F(TlsTest, IsRefusedWithoutTheRightOnes) {
  EXPECT_TRUE(absl::IsUnavailable(Refusal(Options("ca", "stranger"))));
  EXPECT_TRUE(absl::IsUnavailable(Refusal(Options("ca", ""))));
  EXPECT_TRUE(absl::IsUnavailable(Refusal(Options("", ""))));
}

TEST_F(TlsTest, RefusesADaemonOfAnotherAuthority) {
  EXPECT_TRUE(absl::IsUnavailable(Refusal(Options("other", "device"))));
}

TEST_F(TlsTest, TakesCertificatesThatComeLater) {
  std::filesystem::rename(Path("device.pem"), Path("later.pem"));
  SegmentStream stream(Options("ca", "device"), nullptr);
  MotionSegment segment;
  segment.key = {"walk", 0};
  ASSERT_TRUE(stream.Send(segment));
  ASSERT_TRUE(Eventually([&] { return !stream.connection_status().ok(); }));
  const absl::Status status = stream.connection_status();
  EXPECT_TRUE(absl::IsFailedPrecondition(status)) << status;
  EXPECT_NE(std::string(status.message()).find("device.pem"),
            std::string::npos);
  std::filesystem::rename(Path("later.pem"), Path("device.pem"));
  EXPECT_TRUE(stream.Drain(kLong).ok());
}

TEST_F(TlsTest, WantsCertificateAndKeyTogether) {
  ClientOptions options = Options("ca", "device");
  options.key_file.clear();
  EXPECT_TRUE(absl::IsFailedPrecondition(Refusal(options)));
}

}  // namespace
}  // namespace selfcal::client
