// Off the loopback: certificates say who calls and what it may do.
#include <stdio.h>

#include "test/server/console/console_test.h"
#include "test/support/certificates.h"

namespace selfcal::server {
namespace {

using ::testing::HasSubstr;

class TlsTest : public ConsoleTest {
 protected:
  TlsTest() {
    const std::string role = "URI:selfcal://role/";
    certificates_.Add("operator", "ca", role + "administer");
    certificates_.Add("owner", "ca", role + "read/rigs/a");
    certificates_.Add("nobody", "ca", "DNS:nobody.example");
    certificates_.AddAuthority("other");
    certificates_.Add("stranger", "other", role + "administer");
    console_.reset();
    auto console = MakeConsole(&*api_,
                               {"0.0.0.0:0",
                                Role::kRead,
                                {certificates_.Pem("server"),
                                 certificates_.Key("server"),
                                 certificates_.Pem("ca")}});
    if (!console.ok()) throw std::runtime_error(console.status().ToString());
    console_ = *std::move(console);
  }

  // With the certificate of that name; none if it is empty.
  Reply Ask(const std::string& name,
            const std::string& path,
            const std::string& method = "GET",
            const std::string& body = "") {
    const std::string request = certificates_.Pem("request");
    std::ofstream(request) << method << " " << path
                           << " HTTP/1.1\r\nHost: any.example\r\n"
                              "Connection: close\r\nX-Selfcal-Console: 1\r\n"
                              "Content-Length: "
                           << body.size() << "\r\n\r\n"
                           << body;
    const std::string prefix = "https://0.0.0.0:";
    std::string command = "openssl s_client -quiet -connect 127.0.0.1:" +
                          console_->url().substr(prefix.size()) + " -CAfile " +
                          certificates_.Pem("ca") + " -verify_return_error";
    if (!name.empty()) {
      command += " -cert " + certificates_.Pem(name) + " -key " +
                 certificates_.Key(name);
    }
    return Parse(Output(command + " <" + request + " 2>/dev/null"));
  }

  static std::string Output(const std::string& command) {
    FILE* const pipe = popen(command.c_str(), "r");
    std::string output;
    char buffer[4096];
    for (std::size_t n = 0; (n = fread(buffer, 1, sizeof(buffer), pipe)) > 0;) {
      output.append(buffer, n);
    }
    pclose(pipe);
    return output;
  }

  Certificates certificates_;
};

TEST_F(TlsTest, WithoutACertificateOfTheAuthorityNothingIsShown) {
  AddRig("a");
  for (const char* name : {"", "stranger"}) {
    for (const char* path : {"/", "/api/v1/rigs", "/api/v1/rigs/a"}) {
      const Reply reply = Ask(name, path);
      EXPECT_EQ(reply.status, 401) << name << path << reply.body;
      EXPECT_EQ(reply.code(), "UNAUTHENTICATED");
    }
  }
}

TEST_F(TlsTest, CertificateSaysWhichRigs) {
  AddRig("a");
  AddRig("b");
  EXPECT_EQ(Ask("owner", "/").status, 200);
  EXPECT_EQ(Ask("owner", "/api/v1/rigs/a").status, 200);
  EXPECT_EQ(Ask("owner", "/api/v1/rigs/a/events").status, 200);
  for (const char* path :
       {"/api/v1/rigs/b",
        "/api/v1/rigs/b/tables",
        "/api/v1/rigs/b/segments/s~0/data",
        "/api/v1/rigs/b/calibrations/1",
        "/api/v1/rigs/b/calibrations/1:compare?b=rigs/b/calibrations/1",
        "/api/v1/rigs/b/recalibrations",
        "/api/v1/rigs/b/events",
        "/api/v1/rigs/b/changes:watch",
        "/api/v1/rigs/b/recalibrations/1:watch"}) {
    EXPECT_EQ(Ask("owner", path).status, 403) << path;
    EXPECT_EQ(Ask("nobody", path).status, 403) << path;
  }
  EXPECT_EQ(Ask("nobody", "/api/v1/changes:watch").status, 403);
  for (const char* path :
       {"/api/v1/rigs", "/api/v1/events", "/api/v1/activity"}) {
    const Reply reply = Ask("owner", path);
    EXPECT_EQ(reply.status, 200) << path;
    EXPECT_THAT(reply.body, HasSubstr("rigs/a")) << path;
    EXPECT_THAT(reply.body, ::testing::Not(HasSubstr("rigs/b"))) << path;
    EXPECT_EQ(Ask("nobody", path).status, 403) << path;
  }
}

TEST_F(TlsTest, WhoActivatesIsWrittenDown) {
  AddVersion(AddRig("a"));
  constexpr char kPath[] = "/api/v1/rigs/a/calibrations/1:activate";
  constexpr char kReason[] = R"({"reason": "better"})";
  EXPECT_EQ(Ask("owner", kPath, "POST", kReason).status, 403);
  EXPECT_EQ(store_->GetActiveCalibration("a")->version, 2);
  EXPECT_EQ(Ask("operator", kPath, "POST", kReason).status, 200);
  EXPECT_EQ(store_->GetActiveCalibration("a")->version, 1);
  const auto events = store_->ListNewestEvents({1, ""}, "a");
  ASSERT_TRUE(events.ok());
  EXPECT_THAT(events->items.at(0).detail, HasSubstr("operator"));
}

TEST_F(TlsTest, WhatIsNoTlsIsSurvived) {
  const std::string prefix = "https://0.0.0.0:";
  for (const char* bytes : {"GET / HTTP/1.1\r\n\r\n", "\x16\x03\x01\xff\xff"}) {
    Wire wire(std::stoi(console_->url().substr(prefix.size())));
    wire.Send(bytes);
    wire.Send(std::string(1000, '\xfe'));
  }
  EXPECT_EQ(Ask("operator", "/api/v1/rigs").status, 200);
}

}  // namespace
}  // namespace selfcal::server
