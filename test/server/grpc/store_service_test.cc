#include <atomic>
#include <filesystem>

#include "selfcal/v1/store_service.grpc.pb.h"
#include "test/server/grpc/service_test.h"
#include "test/server/store/sqlite/tamper.h"

namespace selfcal::server {
namespace {

using ::testing::ElementsAre;

class StoreServiceTest : public ServiceTest {
 protected:
  StoreServiceTest() : stub_(v1::StoreService::NewStub(channel_)) {}

  v1::CheckStoreResponse::Summary Check(
      std::vector<v1::CheckStoreResponse::Problem>* problems = nullptr) {
    Context context;
    const auto reader = stub_->CheckStore(&context, v1::CheckStoreRequest());
    v1::CheckStoreResponse response;
    v1::CheckStoreResponse::Summary summary;
    while (reader->Read(&response)) {
      EXPECT_FALSE(summary.bytes() > 0) << "something after the summary";
      if (response.has_summary()) summary = response.summary();
      if (response.has_problem() && problems != nullptr) {
        problems->push_back(response.problem());
      }
    }
    const grpc::Status status = reader->Finish();
    EXPECT_TRUE(status.ok()) << status.error_message();
    return summary;
  }

  // The pieces of a backup and its checksum.
  std::pair<std::string, std::string> BackUp() {
    Context context;
    const auto reader = stub_->BackupStore(&context, v1::BackupStoreRequest());
    v1::BackupStoreResponse response;
    std::string bytes;
    std::string sha256;
    while (reader->Read(&response)) {
      bytes += response.data();
      if (response.has_summary()) {
        EXPECT_EQ(response.summary().bytes(),
                  static_cast<std::int64_t>(bytes.size()));
        sha256 = response.summary().sha256();
      }
    }
    EXPECT_TRUE(reader->Finish().ok());
    return {bytes, sha256};
  }

  grpc::Status Restore(const std::string& bytes,
                       const std::string& sha256,
                       v1::RestoreStoreResponse* response) {
    Context context;
    const auto writer = stub_->RestoreStore(&context, response);
    v1::RestoreStoreRequest request;
    request.set_data(bytes);
    writer->Write(request);
    if (!sha256.empty()) {
      request.set_sha256(sha256);
      writer->Write(request);
    }
    writer->WritesDone();
    return writer->Finish();
  }

  std::unique_ptr<v1::StoreService::Stub> stub_;
};

TEST_F(StoreServiceTest, ACheckEndsWithItsSummary) {
  AddScored(2);
  const auto summary = Check();
  EXPECT_EQ(summary.problems(), 0);
  EXPECT_EQ(summary.payloads(), 2);
  EXPECT_GT(summary.checksums(), 4);
}

TEST_F(StoreServiceTest, ACheckTellsEachProblem) {
  AddScored(2);
  ASSERT_TRUE(
      DamageColumn(folder_ / "test.db", "segment_information", "information")
          .ok());
  std::vector<v1::CheckStoreResponse::Problem> problems;
  EXPECT_EQ(Check(&problems).problems(), 2);
  ASSERT_EQ(problems.size(), 2u);
  EXPECT_THAT(problems[0].place(), ::testing::HasSubstr("segment_information"));
  EXPECT_FALSE(problems[0].description().empty());
}

TEST_F(StoreServiceTest, ABackupThatNobodyReadsHoldsUpNoOther) {
  const Rig rig = AddRig("a");
  for (const MotionSegment& segment : TestSegments(rig, 20)) {
    ASSERT_TRUE(domain_->PutSegment("a", segment).ok());
  }
  Context idle;
  const auto unread = stub_->BackupStore(&idle, v1::BackupStoreRequest());
  v1::BackupStoreResponse first;
  ASSERT_TRUE(unread->Read(&first));
  EXPECT_FALSE(BackUp().first.empty());
  EXPECT_FALSE(BackUp().first.empty());
  idle.TryCancel();
  EXPECT_FALSE(unread->Finish().ok());
}

TEST_F(StoreServiceTest, ABackupIsADatabaseAndCanBeRestored) {
  const Rig rig = AddScored(2);
  const auto [bytes, sha256] = BackUp();
  EXPECT_EQ(sha256.size(), 32u);
  v1::RestoreStoreResponse response;
  const grpc::Status status = Restore(bytes, sha256, &response);
  ASSERT_TRUE(status.ok()) << status.error_message();
  EXPECT_THAT(response.previous_database(),
              ::testing::HasSubstr("test.db.before-restore-"));
  server_.reset();
  store_.reset();
  store_ = *OpenSqliteStore(folder_ / "test.db");
  domain_.emplace(store_.get());
  EXPECT_EQ(store_->ListSegments(rig.id, {})->items.size(), 2u);
  EXPECT_TRUE(std::filesystem::exists(response.previous_database()));
}

TEST_F(StoreServiceTest, ARestoreThatIsDamagedIsRefused) {
  AddRig();
  const auto [bytes, sha256] = BackUp();
  v1::RestoreStoreResponse response;
  EXPECT_EQ(Restore(bytes + "x", sha256, &response).error_code(),
            grpc::StatusCode::DATA_LOSS);
  EXPECT_THAT(BadFields(Restore(bytes, "", &response)), ElementsAre("sha256"));
  EXPECT_TRUE(store_->GetRig("r").ok());
}

TEST_F(StoreServiceTest, EventsAreListedOldestFirstAndByRig) {
  AddRig("a");
  AddRig("b");
  for (const auto& segment : TestSegments(TestRig("b"), 1)) {
    ASSERT_TRUE(domain_->PutSegment("b", segment).ok());
    ASSERT_TRUE(domain_->MarkUnusable("b", segment.key, "a reason").ok());
  }
  v1::ListEventsRequest request;
  v1::ListEventsResponse events;
  Context all;
  ASSERT_TRUE(stub_->ListEvents(&all, request, &events).ok());
  ASSERT_EQ(events.events_size(), 5);  // each rig has its factory's version
  EXPECT_EQ(events.events(0).rig(), "rigs/a");
  EXPECT_EQ(events.events(0).kind(), v1::Event::RIG_CREATED);
  EXPECT_EQ(events.events(4).kind(), v1::Event::SEGMENT_UNUSABLE);
  EXPECT_THAT(events.events(4).detail(), ::testing::HasSubstr("a reason"));
  EXPECT_GT(events.events(4).time().seconds(), 0);

  request.set_parent("rigs/b");
  request.set_page_size(1);
  std::vector<std::int64_t> numbers;
  do {
    Context context;
    ASSERT_TRUE(stub_->ListEvents(&context, request, &events).ok());
    for (const auto& event : events.events()) {
      EXPECT_EQ(event.rig(), "rigs/b");
      numbers.push_back(event.number());
    }
    request.set_page_token(events.next_page_token());
  } while (!request.page_token().empty());
  EXPECT_THAT(numbers, ElementsAre(1, 2, 3));
}

TEST_F(StoreServiceTest, EventsOfWhatIsNoRigAreRefused) {
  v1::ListEventsRequest request;
  v1::ListEventsResponse events;
  request.set_parent("rigs/nobody");
  Context first;
  ExpectNotFound(stub_->ListEvents(&first, request, &events), "rigs/nobody");
  request.set_parent("nonsense");
  Context second;
  EXPECT_THAT(BadFields(stub_->ListEvents(&second, request, &events)),
              ElementsAre("parent"));
}

}  // namespace
}  // namespace selfcal::server
