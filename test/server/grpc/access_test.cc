// Only those who may, do: over TCP with certificates, over the socket by its
// permissions.
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <map>
#include <random>
#include <set>
#include <string>
#include <vector>

#include "test/promise.h"
#include "test/server/grpc/methods.h"
#include "test/server/grpc/service_test.h"
#include "test/support/certificates.h"

namespace selfcal::server {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr milliseconds kDeadline{20'000};
// A watch that is let in does not end by itself.
constexpr milliseconds kWatchDeadline{300};

class AccessTest : public ServiceTest {
 protected:
  AccessTest() {
    const std::string role = "URI:selfcal://role/";
    certificates_.Add("admin", "ca", role + "administer");
    certificates_.Add("reader", "ca", role + "read");
    certificates_.Add("device-a", "ca", role + "produce/rigs/a");
    certificates_.Add("north", "ca", role + "administer/labels/site/north");
    certificates_.Add("nothing", "ca", "DNS:nothing,URI:https://x/administer");
    certificates_.AddAuthority("other");
    certificates_.Add("stranger", "other", role + "administer");
    certificates_.Add("expired", "ca", role + "administer", -1);
    AddRig("a");
    AddRig("b");
    const auto labelled = domain_->UpdateRig(
        "b",
        [](StoredRig rig) -> absl::StatusOr<StoredRig> {
          rig.labels["site"] = "north";
          return rig;
        },
        "test");
    if (!labelled.ok()) throw std::runtime_error(labelled.status().ToString());
    ServerOptions options;
    options.listen = {"127.0.0.1:0"};
    options.tls = {certificates_.Pem("server"),
                   certificates_.Key("server"),
                   certificates_.Pem("ca"),
                   1};
    auto server = NewServer(options);
    if (!server.ok()) throw std::runtime_error(server.status().ToString());
    tls_server_ = std::move(*server);
  }

  std::shared_ptr<grpc::Channel> As(const std::string& name,
                                    const std::string& root = "ca") {
    grpc::ChannelArguments arguments;
    arguments.SetInt("test.channel", ++channels_);
    return grpc::CreateCustomChannel(tls_server_->addresses()[0],
                                     certificates_.Client(name, root),
                                     arguments);
  }

  grpc::Status GetRigAs(const std::string& name,
                        const std::string& rig,
                        const std::string& root = "ca") {
    Context context;
    context.set_deadline(std::chrono::system_clock::now() + kDeadline);
    v1::GetRigRequest request;
    request.set_name("rigs/" + rig);
    v1::Rig response;
    return v1::RigService::NewStub(As(name, root))
        ->GetRig(&context, request, &response);
  }

  Certificates certificates_;
  std::unique_ptr<Server> tls_server_;

 private:
  int channels_ = 0;
};

TEST_F(AccessTest, CertificateOfTheAuthorityIsNeeded) {
  EXPECT_TRUE(GetRigAs("admin", "a").ok());
  for (const std::string name : {"", "stranger", "expired"}) {
    EXPECT_EQ(GetRigAs(name, "a").error_code(), grpc::StatusCode::UNAVAILABLE)
        << name;
  }
}

TEST_F(AccessTest, PlainCallerOfAnAddressWithTlsIsRefused) {
  Context context;
  context.set_deadline(std::chrono::system_clock::now() + kDeadline);
  v1::Rig response;
  const auto stub = v1::RigService::NewStub(grpc::CreateChannel(
      tls_server_->addresses()[0], grpc::InsecureChannelCredentials()));
  EXPECT_EQ(stub->GetRig(&context, {}, &response).error_code(),
            grpc::StatusCode::UNAVAILABLE);
}

// A handler without its check would be found here.
TEST_F(AccessTest, EveryMethodAsksForTheRole) {
  const auto nothing = As("nothing");
  const auto reader = As("reader");
  const auto admin = As("admin");
  for (const MethodDescriptor* method : Methods()) {
    for (const std::string name : {"", "rigs/a", "rigs/a/tables/imu"}) {
      const auto request = RequestFor(*method, name);
      EXPECT_EQ(CallWith(nothing, *method, *request, kDeadline).error_code(),
                grpc::StatusCode::PERMISSION_DENIED)
          << method->full_name() << " of " << name;
    }
    const auto request = RequestFor(*method, "rigs/a");
    const bool reads = RuleOf(*method).role == Role::kRead;
    EXPECT_EQ(
        CallWith(reader, *method, *request, kWatchDeadline).error_code() ==
            grpc::StatusCode::PERMISSION_DENIED,
        !reads)
        << method->full_name();
    EXPECT_NE(CallWith(admin, *method, *request, kWatchDeadline).error_code(),
              grpc::StatusCode::PERMISSION_DENIED)
        << method->full_name();
  }
}

// What the rules let pass because no method takes an empty name; lists without
// one are of the rigs of the caller (LimitedCallerTest).
TEST_F(AccessTest, EmptyNameIsNoWayRoundTheRig) {
  const auto device = As("device-a");
  for (const MethodDescriptor* method : Methods()) {
    if (IsLimitedToRights(*method)) continue;
    EXPECT_FALSE(
        CallWith(device, *method, *RequestFor(*method, ""), kDeadline).ok() &&
        !method->client_streaming())
        << method->full_name();
  }
}

TEST_F(AccessTest, DeviceWritesAndReadsItsOwnRigAlone) {
  EXPECT_TRUE(GetRigAs("device-a", "a").ok());
  const grpc::Status other = GetRigAs("device-a", "b");
  EXPECT_EQ(other.error_code(), grpc::StatusCode::PERMISSION_DENIED);
  EXPECT_THAT(other.error_message(), HasSubstr("device-a"));

  const auto segments = TestSegments(TestRig("a"), 2);
  Context context;
  const auto stub = v1::SegmentService::NewStub(As("device-a"));
  const auto stream = stub->StreamSegments(&context);
  v1::StreamSegmentsRequest request;
  v1::StreamSegmentsResponse response;
  request.set_parent("rigs/a");
  *request.mutable_segment() = ToProto(segments[0]);
  ASSERT_TRUE(stream->Write(request));
  ASSERT_TRUE(stream->Read(&response));
  EXPECT_EQ(response.verdict(), v1::StreamSegmentsResponse::STORED);
  request.set_parent("rigs/b");
  *request.mutable_segment() = ToProto(segments[1]);
  ASSERT_TRUE(stream->Write(request));
  EXPECT_FALSE(stream->Read(&response));
  EXPECT_EQ(stream->Finish().error_code(), grpc::StatusCode::PERMISSION_DENIED);
  EXPECT_TRUE(store_->ListSegments("b", Page())->items.empty());
}

// The permissions of the section "Access" of docs/operations.md: on the rig
// that a request names, on the rigs of the caller, or on the whole daemon.
enum class Permission {
  kRead,        // a rig
  kProduce,     // segments of a rig
  kAdminister,  // a rig
  kCreate,      // a rig that has no label yet
  kListOwn,     // the rigs that the caller may read
  kReadAll,
  kAdministerAll,
};

// The permission that each method needs.
const std::map<std::string, Permission>& NeededPermissions() {
  static const std::map<std::string, Permission> kNeeded = {
      {"ListActivity", Permission::kListOwn},
      {"WatchChanges", Permission::kRead},
      {"GetCalibration", Permission::kRead},
      {"ListCalibrations", Permission::kRead},
      {"WatchCalibration", Permission::kRead},
      {"ActivateCalibration", Permission::kAdminister},
      {"CompareCalibrations", Permission::kRead},
      {"AdviseMotion", Permission::kRead},
      {"VerifyRig", Permission::kAdminister},
      {"DescribeCohort", Permission::kListOwn},
      {"ListCohorts", Permission::kReadAll},
      {"ListEstimates", Permission::kRead},
      {"StartRecalibration", Permission::kAdminister},
      {"GetRecalibration", Permission::kRead},
      {"ListRecalibrations", Permission::kRead},
      {"WatchRecalibration", Permission::kRead},
      {"CancelRecalibration", Permission::kAdminister},
      {"CreateRig", Permission::kCreate},
      {"GetRig", Permission::kRead},
      {"UpdateRig", Permission::kAdminister},
      {"DeleteRig", Permission::kAdminister},
      {"ListRigs", Permission::kListOwn},
      {"StreamSegments", Permission::kProduce},
      {"ListSegments", Permission::kRead},
      {"GetSegment", Permission::kRead},
      {"GetSegmentData", Permission::kRead},
      {"GetSegmentInformation", Permission::kRead},
      {"GetSegmentResiduals", Permission::kRead},
      {"ListTables", Permission::kRead},
      {"GetTable", Permission::kRead},
      {"DownloadSegments", Permission::kRead},
      {"DeleteSegment", Permission::kAdminister},
      {"QuarantineSegments", Permission::kAdminister},
      {"ListSessions", Permission::kRead},
      {"GetTrajectory", Permission::kRead},
      {"CheckStore", Permission::kAdministerAll},
      {"BackupStore", Permission::kAdministerAll},
      {"RestoreStore", Permission::kAdministerAll},
      {"ListEvents", Permission::kRead},
      {"Report", Permission::kProduce},
      {"CreateInstruction", Permission::kAdminister},
      {"ListInstructions", Permission::kRead},
  };
  return kNeeded;
}

// The permissions that a certificate gives on each of the rigs.
struct TestCaller {
  std::string certificate;
  bool known = false;
  std::set<Permission> a;
  std::set<Permission> b;
};

std::vector<TestCaller> TestCallers() {
  const std::set<Permission> lists = {Permission::kListOwn};
  const std::set<Permission> reads = {
      Permission::kRead, Permission::kListOwn, Permission::kReadAll};
  const std::set<Permission> sends = {
      Permission::kRead, Permission::kProduce, Permission::kListOwn};
  const std::set<Permission> manages = {Permission::kRead,
                                        Permission::kProduce,
                                        Permission::kAdminister,
                                        Permission::kListOwn};
  return {{"", false, {}, {}},
          {"stranger", false, {}, {}},
          {"expired", false, {}, {}},
          {"nothing", true, {}, {}},
          {"reader", true, reads, reads},
          {"device-a", true, sends, lists},
          {"north", true, lists, manages}};
}

TEST_F(AccessTest, EveryMethodIsInTheTable) {
  std::set<std::string> names;
  for (const MethodDescriptor* method : Methods()) {
    EXPECT_TRUE(names.insert(method->name()).second) << method->full_name();
    EXPECT_TRUE(NeededPermissions().contains(method->name()))
        << method->full_name();
  }
  EXPECT_EQ(names.size(), NeededPermissions().size());
}

// A promise, in the form that the long run counts: callers, methods and rigs at
// random against the table.
TEST_F(AccessTest, NobodyDoesWhatItMayNot) {
  const std::vector<TestCaller> callers = TestCallers();
  Promise promise("only those who may, do");
  const int trials = Trials(50);
  std::mt19937 random(1);
  const auto pick = [&](const auto& from) {
    return from[random() % from.size()];
  };
  for (; promise.trials < trials; ++promise.trials) {
    const TestCaller caller = pick(callers);
    const MethodDescriptor& method = *pick(Methods());
    const std::string name = pick(std::vector<std::string>{"rigs/a", "rigs/b"});
    const auto request = RequestFor(method, name);
    const bool may = (name == "rigs/a" ? caller.a : caller.b)
                         .contains(NeededPermissions().at(method.name()));
    const auto code = CallWith(As(caller.certificate),
                               method,
                               *request,
                               may ? kWatchDeadline : kDeadline)
                          .error_code();
    const bool kept_out = caller.known
                              ? code == grpc::StatusCode::PERMISSION_DENIED
                              : code == grpc::StatusCode::UNAVAILABLE;
    promise.lost += !may && !kept_out;
  }
}

TEST_F(AccessTest, NewCertificatesAreTakenWithoutARestart) {
  ASSERT_FALSE(GetRigAs("stranger", "a", "ca").ok());
  certificates_.Add("server2", "other", "IP:127.0.0.1");
  const auto replace = [&](const std::string& from, const std::string& to) {
    std::filesystem::copy_file(from, to + ".new");
    std::filesystem::rename(to + ".new", to);
  };
  const std::string old_root = certificates_.Pem("old");
  std::filesystem::copy_file(certificates_.Pem("ca"), old_root);
  replace(certificates_.Key("server2"), certificates_.Key("server"));
  replace(certificates_.Pem("server2"), certificates_.Pem("server"));
  replace(certificates_.Pem("other"), certificates_.Pem("ca"));
  EXPECT_TRUE(
      Eventually([&] { return GetRigAs("stranger", "a", "other").ok(); }));
  EXPECT_FALSE(GetRigAs("admin", "a", "other").ok());
  EXPECT_FALSE(GetRigAs("admin", "a", "old").ok());
}

class OpeningTest : public ServiceTest {
 protected:
  absl::Status Open(const ServerOptions& options) {
    return NewServer(options).status();
  }
  Certificates certificates_;
};

TEST_F(OpeningTest, PlainTcpMustBeAskedForByName) {
  ServerOptions options;
  options.listen = {"127.0.0.1:0"};
  const absl::Status refused = Open(options);
  EXPECT_TRUE(absl::IsInvalidArgument(refused));
  EXPECT_THAT(std::string(refused.message()), HasSubstr("insecure:host:port"));
  options.listen = {"insecure:127.0.0.1:0"};
  EXPECT_TRUE(Open(options).ok());
}

TEST_F(OpeningTest, UnusableFilesAreNamedAndNotShown) {
  ServerOptions options;
  options.listen = {"127.0.0.1:0"};
  const TlsOptions good = {certificates_.Pem("server"),
                           certificates_.Key("server"),
                           certificates_.Pem("ca"),
                           1};
  options.tls = good;
  EXPECT_TRUE(Open(options).ok());
  const std::string secret = folder_ / "secret.pem";
  std::ofstream(secret) << "-----BEGIN PRIVATE KEY-----\nc2VjcmV0LXNlY3JldA==\n"
                           "-----END PRIVATE KEY-----\n";
  certificates_.Add("second", "ca", "IP:127.0.0.1");
  for (const std::string& key :
       {secret, certificates_.Key("second"), std::string("/no/such/file")}) {
    options.tls = good;
    options.tls.key = key;
    const absl::Status status = Open(options);
    EXPECT_TRUE(absl::IsFailedPrecondition(status)) << status;
    EXPECT_THAT(std::string(status.message()), HasSubstr(key));
    EXPECT_THAT(std::string(status.message()), Not(HasSubstr("c2Vjcm")));
  }
  options.tls = good;
  options.tls.certificate = "/no/such/file";
  EXPECT_TRUE(absl::IsFailedPrecondition(Open(options)));
  options.tls = good;
  options.tls.client_ca = secret;
  EXPECT_TRUE(absl::IsFailedPrecondition(Open(options)));
  options.tls = good;
  options.tls.client_ca.clear();
  EXPECT_TRUE(absl::IsInvalidArgument(Open(options)));
}

TEST_F(OpeningTest, SocketHasTheModeAndGroupThatWereSet) {
  ServerOptions options;
  const std::string path = folder_ / "socket";
  options.listen = {"unix:" + path};
  options.socket.mode = 0620;
  const auto server = NewServer(options);
  ASSERT_TRUE(server.ok()) << server.status();
  struct stat status {};
  ASSERT_EQ(stat(path.c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777, 0620u);
  EXPECT_EQ(status.st_gid, getegid());

  options.listen = {"unix:" + (folder_ / "other").string()};
  options.socket.group = "no-such-group";
  const absl::Status refused = Open(options);
  EXPECT_TRUE(absl::IsInvalidArgument(refused)) << refused;
  EXPECT_THAT(std::string(refused.message()), HasSubstr("no-such-group"));
}

TEST_F(OpeningTest, RoleOfLocalCallersIsASetting) {
  AddRig("a");
  ServerOptions options;
  options.local_role = Role::kProduce;
  StartServer(options);
  for (const MethodDescriptor* method : Methods()) {
    const auto request = RequestFor(*method, "rigs/a");
    EXPECT_EQ(
        CallWith(channel_, *method, *request, kWatchDeadline).error_code() ==
            grpc::StatusCode::PERMISSION_DENIED,
        RuleOf(*method).role > Role::kProduce)
        << method->full_name();
  }
}

TEST_F(OpeningTest, NumberOfRigsIsLimited) {
  server_.reset();
  OpenDomain({.quotas = {.max_rigs = 2}});
  AddRig("before");
  StartServer(ServerOptions());
  const auto create = [&](const std::string& id) {
    Context context;
    v1::CreateRigRequest request;
    *request.mutable_rig() = ToProto(TestRig(id));
    v1::Rig created;
    return rigs_->CreateRig(&context, request, &created).error_code();
  };
  EXPECT_EQ(create("second"), grpc::StatusCode::OK);
  EXPECT_EQ(create("third"), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_EQ(create("second"), grpc::StatusCode::ALREADY_EXISTS);
}

}  // namespace
}  // namespace selfcal::server
