// Mutual TLS of the client, against certificates made on the spot.
#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "client/selfcal/client.h"
#include "test/client/selfcal/drain.h"
#include "test/client/selfcal/fake_daemon.h"
#include "test/support/certificates.h"
#include "test/support/eventually.h"

namespace selfcal::client {
namespace {

class TlsTest : public ::testing::Test {
 protected:
  TlsTest() {
    certificates_.AddAuthority("other");
    certificates_.Add("device", "ca", "DNS:device");
    certificates_.Add("stranger", "other", "DNS:stranger");
    daemon_.StartOnPort(certificates_.Server());
  }

  ClientOptions Options(const std::string& authority,
                        const std::string& name) const {
    ClientOptions options;
    options.target = daemon_.target();
    options.rig = "device";
    if (!authority.empty()) options.ca_file = certificates_.Pem(authority);
    if (!name.empty()) {
      options.certificate_file = certificates_.Pem(name);
      options.key_file = certificates_.Key(name);
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

  Certificates certificates_;
  FakeDaemon daemon_;
};

TEST_F(TlsTest, StreamsWithACertificateOfTheAuthority) {
  SegmentStream stream(Options("ca", "device"), nullptr);
  MotionSegment segment;
  segment.key = {"walk", 0};
  ASSERT_TRUE(stream.Send(segment));
  EXPECT_TRUE(DrainFully(&stream).ok());
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
  const std::string certificate = certificates_.Pem("device");
  std::filesystem::rename(certificate, certificates_.Pem("later"));
  SegmentStream stream(Options("ca", "device"), nullptr);
  MotionSegment segment;
  segment.key = {"walk", 0};
  ASSERT_TRUE(stream.Send(segment));
  ASSERT_TRUE(Eventually([&] { return !stream.connection_status().ok(); }));
  const absl::Status status = stream.connection_status();
  EXPECT_TRUE(absl::IsFailedPrecondition(status)) << status;
  EXPECT_NE(std::string(status.message()).find("device.pem"),
            std::string::npos);
  std::filesystem::rename(certificates_.Pem("later"), certificate);
  EXPECT_TRUE(DrainFully(&stream).ok());
}

TEST_F(TlsTest, WantsCertificateAndKeyTogether) {
  ClientOptions options = Options("ca", "device");
  options.key_file.clear();
  EXPECT_TRUE(absl::IsFailedPrecondition(Refusal(options)));
}

}  // namespace
}  // namespace selfcal::client
