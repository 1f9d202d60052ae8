#include "proto/convert.h"
#include "test/server/grpc/service_test.h"

namespace selfcal::server {
namespace {

using ::testing::ElementsAre;

class SegmentServiceTest : public ServiceTest {
 protected:
  grpc::Status Get(const std::string& name, v1::Segment* segment) {
    Context context;
    v1::GetSegmentRequest request;
    request.set_name(name);
    return segments_->GetSegment(&context, request, segment);
  }

  grpc::Status List(const std::string& parent,
                    int size,
                    const std::string& token,
                    v1::ListSegmentsResponse* response) {
    Context context;
    v1::ListSegmentsRequest request;
    request.set_parent(parent);
    request.set_page_size(size);
    request.set_page_token(token);
    return segments_->ListSegments(&context, request, response);
  }

  grpc::Status Table(const std::string& name, v1::Table* table) {
    Context context;
    v1::GetTableRequest request;
    request.set_name(name);
    return segments_->GetTable(&context, request, table);
  }

  grpc::Status Tables(const std::string& parent,
                      v1::ListTablesResponse* response) {
    Context context;
    v1::ListTablesRequest request;
    request.set_parent(parent);
    return segments_->ListTables(&context, request, response);
  }
};

TEST_F(SegmentServiceTest, StoredSegmentShowsItsCountsAndNoScore) {
  const Rig rig = AddRig();
  MotionSegment segment = TestSegments(rig, 1, "a b~c")[0];
  ASSERT_TRUE(domain_->PutSegment("r", segment).ok());
  v1::Segment read;
  ASSERT_TRUE(Get("rigs/r/segments/a%20b%7Ec~0", &read).ok());
  EXPECT_EQ(read.name(), "rigs/r/segments/a%20b%7Ec~0");
  EXPECT_EQ(read.state(), v1::Segment::STORED);
  EXPECT_TRUE(read.has_data());
  EXPECT_GT(read.payload_bytes(), 0);
  EXPECT_GT(read.receive_time().seconds(), 1'600'000'000);
  EXPECT_EQ(read.keyframes(), static_cast<int>(segment.keyframes.size()));
  EXPECT_EQ(read.imu_samples(), static_cast<int>(segment.imu.size()));
  EXPECT_EQ(read.landmarks(), static_cast<int>(segment.landmarks.size()));
  EXPECT_EQ(read.observations(), static_cast<int>(segment.observations.size()));
  EXPECT_EQ(read.start_ns(), segment.keyframes.front().t_ns);
  EXPECT_EQ(read.end_ns(), segment.keyframes.back().t_ns);
  EXPECT_EQ(read.sequence(), 1);
  EXPECT_EQ(read.scores_size(), 0);
}

TEST_F(SegmentServiceTest, ScoredSegmentShowsItsScoresAndTables) {
  const Rig rig = AddScored(1);
  v1::Segment read;
  ASSERT_TRUE(Get("rigs/r/segments/s~0", &read).ok());
  EXPECT_EQ(read.state(), v1::Segment::SCORED);
  ASSERT_EQ(read.scores_size(), static_cast<int>(rig.groups.size()));
  int components = 0;
  for (int i = 0; i < read.scores_size(); ++i) {
    EXPECT_EQ(read.scores(i).group(), rig.groups[i].name);
    EXPECT_EQ(read.scores(i).entropy_nats(), -10);
    EXPECT_EQ(read.scores(i).gain_nats(), 10);
    EXPECT_TRUE(read.scores(i).in_table());
    components += read.scores(i).size();
  }
  const int free = static_cast<int>(FreeComponents(rig).size());
  EXPECT_EQ(components, free);
  EXPECT_EQ(read.components(), free);
}

TEST_F(SegmentServiceTest, UnusableSegmentSaysWhy) {
  const Rig rig = AddRig();
  const MotionSegment segment = TestSegments(rig, 1)[0];
  ASSERT_TRUE(domain_->PutSegment("r", segment).ok());
  ASSERT_TRUE(domain_->MarkUnusable("r", segment.key, "broken").ok());
  v1::Segment read;
  ASSERT_TRUE(Get("rigs/r/segments/s~0", &read).ok());
  EXPECT_EQ(read.state(), v1::Segment::UNUSABLE);
  EXPECT_EQ(read.problem(), "broken");
}

TEST_F(SegmentServiceTest, QuarantineTakesASegmentOutAndSaysWhy) {
  AddScored(2);
  Context context;
  v1::QuarantineSegmentsRequest request;
  request.set_parent("rigs/r");
  request.set_session("s");
  request.set_index(1);
  v1::QuarantineSegmentsResponse response;
  EXPECT_THAT(
      BadFields(segments_->QuarantineSegments(&context, request, &response)),
      ElementsAre("reason"));
  request.set_reason("diverged");
  Context again;
  ASSERT_TRUE(segments_->QuarantineSegments(&again, request, &response).ok());
  EXPECT_EQ(response.quarantined(), 1);
  v1::Segment read;
  ASSERT_TRUE(Get("rigs/r/segments/s~1", &read).ok());
  EXPECT_EQ(read.state(), v1::Segment::UNUSABLE);
  EXPECT_THAT(read.problem(), ::testing::HasSubstr("diverged"));
  ASSERT_TRUE(Get("rigs/r/segments/s~0", &read).ok());
  EXPECT_EQ(read.state(), v1::Segment::SCORED);
  Context all;
  request.clear_index();
  ASSERT_TRUE(segments_->QuarantineSegments(&all, request, &response).ok());
  EXPECT_EQ(response.quarantined(), 1);
  EXPECT_EQ(response.unusable(), 1);
  Context none;
  request.set_session("t");
  EXPECT_EQ(
      segments_->QuarantineSegments(&none, request, &response).error_code(),
      grpc::StatusCode::NOT_FOUND);
}

TEST_F(SegmentServiceTest, ASegmentThatDoesNotFitSaysWhyNoTableHoldsIt) {
  const Rig rig = AddRig();
  for (const MotionSegment& segment : TestSegments(rig, 5)) {
    ASSERT_TRUE(domain_->PutSegment("r", segment).ok());
    SegmentInformation information = TestInformation(rig, 9);
    information.residuals.fit = segment.key.index == 4 ? 25 : 1.5;
    ASSERT_TRUE(domain_->CommitScore("r", segment.key, information).ok());
  }
  v1::Segment read;
  ASSERT_TRUE(Get("rigs/r/segments/s~4", &read).ok());
  EXPECT_EQ(read.residuals().fit(), 25);
  ASSERT_EQ(read.exclusions_size(), static_cast<int>(rig.groups.size()));
  EXPECT_EQ(read.exclusions(0).group(), rig.groups[0].name);
  EXPECT_THAT(read.exclusions(0).reason(), ::testing::HasSubstr("25"));
  EXPECT_THAT(read.exclusions(0).reason(), ::testing::HasSubstr("2.25"));
}

TEST_F(SegmentServiceTest, SegmentThatDoesNotExistIsNotFound) {
  v1::Segment read;
  ExpectNotFound(Get("rigs/r/segments/s~0", &read), "rigs/r/segments/s~0");
  AddRig();
  ExpectNotFound(Get("rigs/r/segments/s~0", &read), "rigs/r/segments/s~0");
  ExpectNotFound(Get("rigs/r/segments/%FF%00~0", &read),
                 "rigs/r/segments/%FF%00~0");
}

TEST_F(SegmentServiceTest, WhatIsNoNameIsRefused) {
  v1::Segment read;
  for (const std::string name : {"", "rigs/r", "rigs/r/segments/s"}) {
    EXPECT_THAT(BadFields(Get(name, &read)), ElementsAre("name"));
  }
  v1::ListSegmentsResponse page;
  EXPECT_THAT(BadFields(List("r", 0, "", &page)), ElementsAre("parent"));
  v1::Table table;
  EXPECT_THAT(BadFields(Table("rigs/r/tables/", &table)), ElementsAre("name"));
  v1::ListTablesResponse tables;
  EXPECT_THAT(BadFields(Tables("rigs/", &tables)), ElementsAre("parent"));
}

TEST_F(SegmentServiceTest, PagesHoldEverySegmentOnceNewestFirst) {
  for (const MotionSegment& segment : TestSegments(AddRig(), 5)) {
    ASSERT_TRUE(domain_->PutSegment("r", segment).ok());
  }
  std::vector<std::int64_t> sequences;
  std::string token;
  int pages = 0;
  do {
    v1::ListSegmentsResponse page;
    ASSERT_TRUE(List("rigs/r", 2, token, &page).ok());
    for (const auto& s : page.segments()) sequences.push_back(s.sequence());
    token = page.next_page_token();
  } while (!token.empty() && ++pages < 10);
  EXPECT_THAT(sequences, ElementsAre(5, 4, 3, 2, 1));
}

TEST_F(SegmentServiceTest, ListOfAnUnknownRigOrPageIsRefused) {
  v1::ListSegmentsResponse page;
  ExpectNotFound(List("rigs/r", 0, "", &page), "rigs/r");
  AddRig();
  EXPECT_THAT(BadFields(List("rigs/r", -7, "", &page)),
              ElementsAre("page_size"));
  EXPECT_THAT(BadFields(List("rigs/r", 7, "%", &page)),
              ElementsAre("page_token"));
}

TEST_F(SegmentServiceTest, DataComesBackAsItWasSentWhileItIsKept) {
  // The tables keep two, the reserve some, and the first goes with the run that
  // used it.
  constexpr int kCount = 3 + kReserve;
  const Rig rig = AddScored(kCount);
  FinishRun(rig, 1);
  const auto sent = TestSegments(rig, kCount, "s");
  int kept = 0;
  for (int k = 0; k < kCount; ++k) {
    Context context;
    v1::GetSegmentDataRequest request;
    request.set_name("rigs/r/segments/s~" + std::to_string(k));
    v1::MotionSegment data;
    const auto status = segments_->GetSegmentData(&context, request, &data);
    if (store_->GetSegment("r", {"s", k})->has_data) {
      ++kept;
      ASSERT_TRUE(status.ok()) << status.error_message();
      EXPECT_EQ(data.SerializeAsString(), ToProto(sent[k]).SerializeAsString());
    } else {
      EXPECT_EQ(status.error_code(), grpc::StatusCode::FAILED_PRECONDITION);
    }
  }
  EXPECT_EQ(kept, kCount - 1);
  Context context;
  v1::GetSegmentDataRequest request;
  request.set_name("rigs/r/segments/s~9");
  v1::MotionSegment data;
  ExpectNotFound(segments_->GetSegmentData(&context, request, &data),
                 "rigs/r/segments/s~9");
}

TEST_F(SegmentServiceTest, ListsByFilterInAnOrder) {
  const Rig rig = AddScored(3);
  ASSERT_TRUE(
      domain_->PutSegment("r", TestSegments(rig, 1, "unscored")[0]).ok());
  Context context;
  v1::ListSegmentsRequest request;
  request.set_parent("rigs/r");
  request.set_filter("state = SCORED AND session = s");
  request.set_order_by("receive_time asc");
  v1::ListSegmentsResponse response;
  ASSERT_TRUE(segments_->ListSegments(&context, request, &response).ok());
  ASSERT_EQ(response.segments_size(), 3);
  EXPECT_EQ(response.segments(0).name(), "rigs/r/segments/s~0");

  request.set_filter("state = scored");
  Context wrong_filter;
  EXPECT_THAT(
      BadFields(segments_->ListSegments(&wrong_filter, request, &response)),
      ElementsAre("filter"));
  request.set_filter("");
  request.set_order_by("colour");
  Context wrong_order;
  EXPECT_THAT(
      BadFields(segments_->ListSegments(&wrong_order, request, &response)),
      ElementsAre("order_by"));
}

TEST_F(SegmentServiceTest, TablesShowTheRichestFirst) {
  const Rig rig = AddScored(3);
  v1::ListTablesResponse response;
  ASSERT_TRUE(Tables("rigs/r", &response).ok());
  ASSERT_EQ(response.tables_size(), static_cast<int>(rig.groups.size()));
  for (int i = 0; i < response.tables_size(); ++i) {
    const v1::Table& table = response.tables(i);
    EXPECT_EQ(table.name(), "rigs/r/tables/" + rig.groups[i].name);
    EXPECT_EQ(table.capacity(), 2);
    EXPECT_EQ(table.scored(), 3);
    EXPECT_FALSE(table.starved());
    ASSERT_EQ(table.entries_size(), 2);
    EXPECT_EQ(table.entries(0).segment(), "rigs/r/segments/s~2");
    EXPECT_EQ(table.entries(0).entropy_nats(), -12);
    EXPECT_EQ(table.entries(0).gain_nats(), 12);
    EXPECT_EQ(table.entries(1).segment(), "rigs/r/segments/s~1");
    v1::Table one;
    ASSERT_TRUE(Table(table.name(), &one).ok());
    EXPECT_EQ(one.SerializeAsString(), table.SerializeAsString());
  }
}

TEST_F(SegmentServiceTest, TableOfAnUnknownGroupOrRigIsNotFound) {
  v1::Table table;
  ExpectNotFound(Table("rigs/r/tables/imu", &table), "rigs/r/tables/imu");
  AddRig();
  ExpectNotFound(Table("rigs/r/tables/gnss", &table), "rigs/r/tables/gnss");
  v1::ListTablesResponse tables;
  ExpectNotFound(Tables("rigs/nobody", &tables), "rigs/nobody");
}

TEST_F(SegmentServiceTest, DownloadSendsWhatIsStoredOldestFirst) {
  const Rig rig = AddRig();
  for (const char* session : {"a", "b"}) {
    for (const MotionSegment& segment : TestSegments(rig, 2, session)) {
      ASSERT_TRUE(domain_->PutSegment(rig.id, segment).ok());
    }
  }
  ASSERT_TRUE(domain_->MarkUnusable("r", {"b", 0}, "test").ok());
  const auto download = [&](const std::string& filter) {
    Context context;
    v1::DownloadSegmentsRequest request;
    request.set_parent("rigs/r");
    request.set_filter(filter);
    const auto reader = segments_->DownloadSegments(&context, request);
    std::vector<std::string> names;
    v1::DownloadSegmentsResponse response;
    while (reader->Read(&response)) {
      names.push_back(response.name());
      EXPECT_GT(response.segment().keyframes().t_ns_size(), 0);
    }
    const auto status = reader->Finish();
    if (!status.ok()) names = BadFields(status);
    return names;
  };
  EXPECT_THAT(
      download(""),
      ElementsAre(
          "rigs/r/segments/a~0", "rigs/r/segments/a~1", "rigs/r/segments/b~1"));
  EXPECT_THAT(download("session = a"),
              ElementsAre("rigs/r/segments/a~0", "rigs/r/segments/a~1"));
  EXPECT_THAT(download("colour = 1"), ElementsAre("filter"));
}

TEST_F(SegmentServiceTest, DeletedSegmentIsGone) {
  const Rig rig = AddRig();
  const MotionSegment segment = TestSegments(rig, 1)[0];
  ASSERT_TRUE(domain_->PutSegment(rig.id, segment).ok());
  v1::DeleteSegmentRequest request;
  request.set_name("rigs/r/segments/s~0");
  google::protobuf::Empty nothing;
  {
    Context context;
    EXPECT_THAT(
        BadFields(segments_->DeleteSegment(&context, request, &nothing)),
        ElementsAre("reason"));
  }
  request.set_reason("private");
  {
    Context context;
    const auto status = segments_->DeleteSegment(&context, request, &nothing);
    ASSERT_TRUE(status.ok()) << status.error_message();
  }
  Context context;
  ExpectNotFound(segments_->DeleteSegment(&context, request, &nothing),
                 "rigs/r/segments/s~0");
}

}  // namespace
}  // namespace selfcal::server
