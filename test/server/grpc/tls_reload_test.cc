// Renewal of the TLS files while the daemon serves.

#include "server/access/tls_reload.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <ctime>
#include <fstream>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "server/access/tls_files.h"
#include "test/server/grpc/service_test.h"
#include "test/support/certificates.h"
#include "test/support/eventually.h"

namespace selfcal::server {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::SizeIs;

constexpr std::int64_t kDay = 86'400;

class TlsReloadTest : public ServiceTest {
 protected:
  TlsReloadTest() {
    certificates_.Add("client", "ca", "URI:selfcal://role/administer");
    certificates_.Add("renewed", "ca", "IP:127.0.0.1", 9);
    options_ = {certificates_.Pem("server"),
                certificates_.Key("server"),
                certificates_.Pem("ca"),
                1};
    client_ = certificates_.Client("client");
  }

  void Serve() {
    ServerOptions options;
    options.listen = {"127.0.0.1:0"};
    options.tls = options_;
    auto server = NewServer(options, [this](const std::string& reason) {
      const std::lock_guard lock(mutex_);
      refusals_.push_back(reason);
    });
    ASSERT_TRUE(server.ok()) << server.status();
    served_ = *std::move(server);
  }

  std::vector<std::string> Refusals() const {
    const std::lock_guard lock(mutex_);
    return refusals_;
  }

  // A call on a connection of its own.
  bool CanCall() const {
    grpc::ChannelArguments separate;
    separate.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
    const auto stub = v1::RigService::NewStub(
        grpc::CreateCustomChannel(served_->addresses()[0], client_, separate));
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() +
                         std::chrono::seconds(20));
    v1::ListRigsResponse response;
    return stub->ListRigs(&context, {}, &response).ok();
  }

  Certificates certificates_;
  TlsOptions options_;
  std::shared_ptr<grpc::ChannelCredentials> client_;
  mutable std::mutex mutex_;
  std::vector<std::string> refusals_;
  std::unique_ptr<Server> served_;
};

struct Unusable {
  std::string name;
  std::string says;
  std::function<void(Certificates*, const TlsOptions&)> replace;
};

void Copy(const std::string& from, const std::string& to) {
  WriteBytes(to, ReadBytes(from));
}

const std::vector<Unusable>& AllUnusable() {
  static const std::vector<Unusable> all = {
      {"the key of another certificate",
       "it is not that of",
       [](Certificates* c, const TlsOptions& files) {
         Copy(c->Key("renewed"), files.key);
       }},
      {"a key that is cut off",
       "cannot use the key",
       [](Certificates*, const TlsOptions& files) {
         const std::string key = ReadBytes(files.key);
         WriteBytes(files.key, key.substr(0, key.size() / 2));
       }},
      {"a key with a passphrase",
       "cannot use the key",
       [](Certificates* c, const TlsOptions& files) {
         c->Encrypt("renewed", files.key);
       }},
      {"an empty certificate",
       "cannot use the certificate",
       [](Certificates*, const TlsOptions& files) {
         WriteBytes(files.certificate, "");
       }},
      {"a certificate that is not PEM",
       "cannot use the certificate",
       [](Certificates*, const TlsOptions& files) {
         WriteBytes(files.certificate, std::string("\x30\x82\x00\xff", 4));
       }},
      {"an expired certificate",
       "it expired on",
       [](Certificates* c, const TlsOptions& files) {
         c->Add("expired", "ca", "IP:127.0.0.1", -1);
         Copy(c->Pem("expired"), files.certificate);
         Copy(c->Key("expired"), files.key);
       }},
      {"a client authority that is cut off",
       "cannot use the client authority",
       [](Certificates*, const TlsOptions& files) {
         const std::string ca = ReadBytes(files.client_ca);
         WriteBytes(files.client_ca, ca.substr(0, ca.size() / 2));
       }},
      {"a file that is missing",
       "it cannot be read",
       [](Certificates*, const TlsOptions& files) {
         std::filesystem::remove(files.certificate);
       }},
  };
  return all;
}

TEST_F(TlsReloadTest, FilesThatCannotBeUsedAreNotTakenUp) {
  Serve();
  std::size_t refused = 0;
  const std::string certificate = ReadBytes(options_.certificate);
  const std::string key = ReadBytes(options_.key);
  const std::string client_ca = ReadBytes(options_.client_ca);
  for (const Unusable& unusable : AllUnusable()) {
    SCOPED_TRACE(unusable.name);
    unusable.replace(&certificates_, options_);
    ASSERT_TRUE(Eventually([&] { return Refusals().size() == refused + 1; }));
    EXPECT_THAT(Refusals().back(), HasSubstr(unusable.says));
    EXPECT_EQ(served_->tls()->Problem(), Refusals().back());
    EXPECT_TRUE(CanCall());
    ++refused;
    WriteBytes(options_.certificate, certificate);
    WriteBytes(options_.key, key);
    WriteBytes(options_.client_ca, client_ca);
    ASSERT_TRUE(Eventually([&] { return served_->tls()->Problem().empty(); }));
  }
  EXPECT_THAT(Refusals(), SizeIs(AllUnusable().size()));
}

TEST_F(TlsReloadTest, FilesThatCanBeUsedServeTheNextConnection) {
  Serve();
  const std::int64_t before_s = served_->tls()->Current()->expiry_s;
  EXPECT_NEAR(static_cast<double>(before_s),
              static_cast<double>(std::time(nullptr) + 2 * kDay),
              600);
  // An authority that the client does not know, then one that it does.
  certificates_.AddAuthority("other");
  certificates_.Add("foreign", "other", "IP:127.0.0.1", 5);
  for (const auto& [name, trusted] :
       {std::pair{"foreign", false}, std::pair{"renewed", true}}) {
    Copy(certificates_.Pem(name), options_.certificate);
    Copy(certificates_.Key(name), options_.key);
    const std::string now = ReadBytes(options_.certificate);
    ASSERT_TRUE(Eventually(
        [&] { return served_->tls()->Current()->certificate == now; }));
    EXPECT_EQ(CanCall(), trusted) << name;
  }
  EXPECT_GT(served_->tls()->Current()->expiry_s, before_s + 6 * kDay);
  EXPECT_THAT(served_->tls()->Problem(), IsEmpty());
}

TEST_F(TlsReloadTest, ACertificateThatIsNotYetValidNamesTheClock) {
  const auto early = ReadTlsFiles(options_, std::time(nullptr) - 2 * kDay);
  EXPECT_THAT(std::string(early.status().message()), HasSubstr("clock"));
  const auto late = ReadTlsFiles(options_, std::time(nullptr) + 3 * kDay);
  EXPECT_THAT(std::string(late.status().message()), HasSubstr("expired"));
  EXPECT_THAT(std::string(late.status().message()), Not(HasSubstr("BEGIN")));
}

}  // namespace
}  // namespace selfcal::server
