// selfcald with its records in a PostgreSQL database.
#include <gmock/gmock.h>
#include <signal.h>

#include <memory>
#include <string>
#include <vector>

#include "selfcal/v1/store_service.grpc.pb.h"
#include "test/server/daemon/daemon_fixture.h"
#include "test/server/store/postgres/postgres_cluster.h"
#include "test/support/grpc_health.h"

namespace selfcal::server {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

class PostgresDaemonTest : public DaemonTest {
 protected:
  void SetUp() override {
    const std::string why_not = PostgresCluster::WhyNot();
    if (!why_not.empty()) GTEST_SKIP() << why_not;
    cluster_ = std::make_unique<PostgresCluster>();
    cluster_->Create("fleet");
  }

  // The address, with a password that the server does not ask for.
  std::vector<std::string> Store() const {
    std::string uri = cluster_->Uri("fleet");
    uri.insert(uri.find('@'), ":secret");
    return {"--store", uri};
  }

  bool HealthBecomes(const std::string& health) const {
    return Eventually([&] { return HealthOf(channel_.get(), "") == health; },
                      kLongWait,
                      kDaemonInterval);
  }

  std::unique_ptr<PostgresCluster> cluster_;
};

TEST_F(PostgresDaemonTest, WhatIsAcknowledgedSurvivesAKill) {
  {
    const auto daemon = StartAndWait(Store());
    Stream(TestSegments(CreateRig(), 3));
    daemon->Signal(SIGKILL);
    EXPECT_EQ(daemon->Wait(), -SIGKILL);
  }
  EXPECT_FALSE(std::filesystem::exists(state_ / "selfcal.db"));
  const auto daemon = StartAndWait(Store());
  EXPECT_EQ(Segments().segments_size(), 3);
  EXPECT_TRUE(AllScored());
  EXPECT_EQ(Tables().tables(0).entries_size(), 2);
  daemon->Signal(SIGTERM);
  EXPECT_EQ(daemon->Wait(), 0);
  EXPECT_THAT(daemon->Log(), HasSubstr("database: postgresql://postgres@"));
  EXPECT_THAT(daemon->Log(), Not(HasSubstr("secret")));
}

TEST_F(PostgresDaemonTest, WorkGoesOnAfterTheServerWasAway) {
  const auto daemon = StartAndWait(Store());
  const Rig rig = CreateRig();
  cluster_->Stop(SIGINT);
  {
    grpc::ClientContext context;
    v1::ListSegmentsRequest request;
    request.set_parent("rigs/r");
    v1::ListSegmentsResponse response;
    const auto stub = v1::SegmentService::NewStub(channel_);
    const grpc::Status status =
        stub->ListSegments(&context, request, &response);
    EXPECT_EQ(status.error_code(), grpc::StatusCode::UNAVAILABLE)
        << status.error_message();
  }
  cluster_->Start();
  EXPECT_TRUE(Eventually(
      [&] {
        grpc::ClientContext context;
        v1::ListRigsRequest request;
        v1::ListRigsResponse response;
        const auto stub = v1::RigService::NewStub(channel_);
        return stub->ListRigs(&context, request, &response).ok();
      },
      kLongWait,
      kDaemonInterval));
  Stream(TestSegments(rig, 2));
  EXPECT_TRUE(AllScored());
}

TEST_F(PostgresDaemonTest, HealthFollowsTheDatabase) {
  const auto daemon = StartAndWait(Store());
  EXPECT_TRUE(HealthBecomes(kServing));
  cluster_->Stop(SIGINT);
  EXPECT_TRUE(HealthBecomes(kNotServing));
  cluster_->Start();
  EXPECT_TRUE(HealthBecomes(kServing));
}

TEST_F(PostgresDaemonTest, BackupsAreLeftToTheEngineAndChecksAreNot) {
  const auto daemon = StartAndWait(Store());
  CreateRig();
  const auto stub = v1::StoreService::NewStub(channel_);
  {
    grpc::ClientContext context;
    const auto reader = stub->BackupStore(&context, v1::BackupStoreRequest());
    v1::BackupStoreResponse response;
    while (reader->Read(&response)) {
    }
    const grpc::Status status = reader->Finish();
    EXPECT_EQ(status.error_code(), grpc::StatusCode::UNIMPLEMENTED);
    EXPECT_THAT(status.error_message(), HasSubstr("tools of its engine"));
  }
  Process doctor({SELFCAL_PATH,
                  "--target",
                  "unix:" + (state_ / "selfcald.sock").string(),
                  "daemon",
                  "doctor"},
                 folder_ / "doctor");
  EXPECT_EQ(doctor.Wait(), 0) << doctor.Log();
}

TEST_F(PostgresDaemonTest, TheCheckOfTheSettingsReachesTheServer) {
  std::vector<std::string> arguments = Store();
  arguments.emplace_back("--check");
  {
    const auto check = Start(arguments);
    EXPECT_EQ(check->Wait(), 0) << check->Log();
  }
  cluster_->Stop(SIGINT);
  for (const bool only_check : {true, false}) {
    const auto failing = Start(only_check ? arguments : Store());
    EXPECT_EQ(failing->Wait(), 1);
    EXPECT_THAT(failing->Log(), HasSubstr("the connection to the database"));
    EXPECT_THAT(failing->Log(), Not(HasSubstr("secret")));
  }
}

// Several daemons on one database, each with a state directory of its own.
class ReplicaDaemonTest : public PostgresDaemonTest {
 protected:
  std::filesystem::path Socket(int replica) const {
    return folder_ / ("socket" + std::to_string(replica));
  }

  std::unique_ptr<Process> StartReplica(int replica) {
    std::vector<std::string> arguments = {
        SELFCALD_PATH,
        "--state-dir",
        (folder_ / ("state" + std::to_string(replica))).string(),
        "--listen",
        "unix:" + Socket(replica).string()};
    const auto store = Store();
    arguments.insert(arguments.end(), store.begin(), store.end());
    auto daemon = std::make_unique<Process>(
        arguments, folder_ / ("replica" + std::to_string(++started_)));
    EXPECT_TRUE(daemon->Says("selfcald ready: listening on unix:"))
        << daemon->Log();
    return daemon;
  }

  std::shared_ptr<grpc::Channel> ChannelTo(int replica) const {
    return grpc::CreateChannel("unix:" + Socket(replica).string(),
                               grpc::InsecureChannelCredentials());
  }

 private:
  int started_ = 0;
};

TEST_F(ReplicaDaemonTest, WhatOneLeavesUndoneAnotherDoes) {
  auto first = StartReplica(1);
  channel_ = ChannelTo(1);
  CreateRig();
  const auto segments = TestSegments(TestRig("r"), 4);
  Stream({segments[0], segments[1]});
  ASSERT_TRUE(AllScored());
  const auto second = StartReplica(2);
  Stream({segments[2]});
  first->Signal(SIGKILL);
  EXPECT_EQ(first->Wait(), -SIGKILL);
  channel_ = ChannelTo(2);
  Stream({segments[3]});
  EXPECT_EQ(Segments().segments_size(), 4);
  EXPECT_TRUE(AllScored());
}

TEST_F(DaemonTest, SettingsOfTheStoreThatCannotBeUsedAreRefused) {
  const auto daemon = Start({"--store",
                             "postgresql://hub:secret@localhost/fleet",
                             "--max-database-bytes",
                             "1000000000"});
  EXPECT_EQ(daemon->Wait(), 1);
  EXPECT_THAT(daemon->Log(), HasSubstr("max-database-bytes"));
  for (const char* uri :
       {"mysql://hub:secret@localhost/fleet",
        "postgresql://hub:secret@localhost/fleet?colour=red"}) {
    const auto wrong = Start({"--store", uri});
    EXPECT_EQ(wrong->Wait(), 2);
    EXPECT_THAT(wrong->Log(), HasSubstr("postgresql://user@host"));
    EXPECT_THAT(wrong->Log(), Not(HasSubstr("secret")));
  }
}

}  // namespace
}  // namespace selfcal::server
