#include <chrono>

#include "selfcal/v1/activity_service.grpc.pb.h"
#include "test/server/grpc/service_test.h"

namespace selfcal::server {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

class RigServiceTest : public ServiceTest {
 protected:
  grpc::Status Create(const v1::Rig& rig, v1::Rig* created = nullptr) {
    Context context;
    v1::CreateRigRequest request;
    *request.mutable_rig() = rig;
    v1::Rig response;
    const grpc::Status status = rigs_->CreateRig(&context, request, &response);
    if (created != nullptr) *created = response;
    return status;
  }

  grpc::Status Get(const std::string& name, v1::Rig* rig) {
    Context context;
    v1::GetRigRequest request;
    request.set_name(name);
    return rigs_->GetRig(&context, request, rig);
  }

  grpc::Status List(int size,
                    const std::string& token,
                    v1::ListRigsResponse* response) {
    Context context;
    v1::ListRigsRequest request;
    request.set_page_size(size);
    request.set_page_token(token);
    return rigs_->ListRigs(&context, request, response);
  }
};

TEST_F(RigServiceTest, CreatedRigIsReturnedWithItsTimeAndCanBeRead) {
  const v1::Rig rig = ToProto(TestRig("r"));
  v1::Rig created;
  ASSERT_TRUE(Create(rig, &created).ok());
  EXPECT_GT(created.create_time().seconds(), 1'600'000'000);
  v1::Rig read;
  ASSERT_TRUE(Get("rigs/r", &read).ok());
  EXPECT_EQ(read.SerializeAsString(), created.SerializeAsString());
  created.clear_create_time();
  EXPECT_EQ(created.SerializeAsString(), rig.SerializeAsString());
}

TEST_F(RigServiceTest, AgesAndIntervalsAreKeptOrRefused) {
  v1::Rig rig = ToProto(TestRig("r"));
  rig.mutable_table_max_age()->set_seconds(86400);
  rig.mutable_recalibration_min_interval()->set_nanos(500'000'000);
  rig.mutable_calibration_max_age()->set_seconds(604800);
  ASSERT_TRUE(Create(rig).ok());
  v1::Rig read;
  ASSERT_TRUE(Get("rigs/r", &read).ok());
  EXPECT_EQ(read.table_max_age().seconds(), 86400);
  EXPECT_EQ(read.recalibration_min_interval().nanos(), 500'000'000);
  EXPECT_EQ(read.calibration_max_age().seconds(), 604800);
  rig.set_name("rigs/s");
  rig.mutable_table_max_age()->set_seconds(-1);
  rig.mutable_calibration_max_age()->set_seconds(10'000'000'000);
  rig.mutable_recalibration_min_interval()->set_nanos(1'000'000'000);
  EXPECT_THAT(BadFields(Create(rig)),
              ElementsAre("rig.table_max_age",
                          "rig.recalibration_min_interval",
                          "rig.calibration_max_age"));
}

TEST_F(RigServiceTest, FactoryCalibrationBecomesVersionOneAndActive) {
  ASSERT_TRUE(Create(ToProto(TestRig("r"))).ok());
  Context context;
  v1::GetCalibrationRequest request;
  request.set_name("rigs/r/calibrations/active");
  v1::Calibration active;
  ASSERT_TRUE(calibrations_->GetCalibration(&context, request, &active).ok());
  EXPECT_EQ(active.name(), "rigs/r/calibrations/1");
  EXPECT_EQ(active.state(), v1::Calibration::ACTIVE);
  EXPECT_FALSE(active.has_provenance());
  EXPECT_EQ(active.parameters().SerializeAsString(),
            ToProto(TestRig("r").factory).SerializeAsString());
}

TEST_F(RigServiceTest, EveryViolationOfANewRigIsListedByItsPath) {
  v1::Rig rig = ToProto(TestRig("r"));
  rig.mutable_factory()->mutable_imu()->mutable_q_ai()->set_w(3);
  rig.mutable_groups(1)->set_group("");
  rig.mutable_imu_noise()->set_gyro_noise_density(0);
  rig.set_table_size(-1);
  EXPECT_THAT(BadFields(Create(rig)),
              ElementsAre("rig.factory.imu.q_ai",
                          "rig.imu_noise.gyro_noise_density",
                          "rig.groups[1].group",
                          "rig.table_size"));
}

TEST_F(RigServiceTest, RigOfTheWrongShapeIsRefused) {
  v1::Rig rig = ToProto(TestRig("r"));
  rig.set_name("rigs/Not Allowed");
  rig.mutable_factory()->mutable_cameras(0)->add_distortion(1);
  EXPECT_THAT(BadFields(Create(rig)),
              ElementsAre("rig.name", "rig.factory.cameras[0].distortion"));
  Context context;
  v1::Rig response;
  EXPECT_THAT(BadFields(rigs_->CreateRig(&context, {}, &response)),
              ElementsAre("rig"));
}

TEST_F(RigServiceTest, AnErrorReachesItsClientHoweverMuchIsWrong) {
  v1::Rig rig = ToProto(TestRig("r"));
  for (int i = 0; i < 900; ++i) {
    rig.add_fixed(std::string(5000, 'x') + "\xc3\xa9");
  }
  const grpc::Status status = Create(rig);
  const auto fields = BadFields(status);
  EXPECT_GT(fields.size(), 5u);
  EXPECT_THAT(fields, Contains("rig.fixed[3]"));
  const auto request = DetailOf<google::rpc::BadRequest>(status);
  EXPECT_THAT(request.field_violations().rbegin()->description(),
              HasSubstr("more"));
}

TEST_F(RigServiceTest, SecondRigOfTheSameNameIsRefused) {
  ASSERT_TRUE(Create(ToProto(TestRig("r"))).ok());
  const grpc::Status again = Create(ToProto(TestRig("r")));
  EXPECT_EQ(again.error_code(), grpc::StatusCode::ALREADY_EXISTS);
  const auto resource = DetailOf<google::rpc::ResourceInfo>(again);
  EXPECT_EQ(resource.resource_type(), "selfcal.v1.Rig");
  EXPECT_EQ(resource.resource_name(), "rigs/r");
}

TEST_F(RigServiceTest, RigThatDoesNotExistIsNotFound) {
  v1::Rig rig;
  ExpectNotFound(Get("rigs/nobody", &rig), "rigs/nobody");
}

TEST_F(RigServiceTest, WhatIsNoNameIsRefused) {
  v1::Rig rig;
  for (const std::string& name :
       {std::string(), std::string("nobody"), std::string(1 << 20, 'a')}) {
    EXPECT_THAT(BadFields(Get(name, &rig)), ElementsAre("name"));
  }
}

TEST_F(RigServiceTest, PagesHoldEveryRigOnceInTheOrderOfNames) {
  for (const std::string id : {"d", "a", "c", "e", "b"}) AddRig(id);
  std::vector<std::string> names;
  std::string token;
  int pages = 0;
  do {
    v1::ListRigsResponse page;
    ASSERT_TRUE(List(2, token, &page).ok());
    EXPECT_LE(page.rigs_size(), 2);
    for (const v1::Rig& rig : page.rigs()) names.push_back(rig.name());
    token = page.next_page_token();
  } while (!token.empty() && ++pages < 10);
  EXPECT_THAT(names,
              ElementsAre("rigs/a", "rigs/b", "rigs/c", "rigs/d", "rigs/e"));
}

TEST_F(RigServiceTest, DefaultPageHoldsFiftyAndHugeOnesAThousand) {
  for (int i = 0; i < 60; ++i) AddRig("r" + std::to_string(i));
  v1::ListRigsResponse page;
  ASSERT_TRUE(List(0, "", &page).ok());
  EXPECT_EQ(page.rigs_size(), 50);
  EXPECT_FALSE(page.next_page_token().empty());
  ASSERT_TRUE(List(std::numeric_limits<int>::max(), "", &page).ok());
  EXPECT_EQ(page.rigs_size(), 60);
  EXPECT_TRUE(page.next_page_token().empty());
}

TEST_F(RigServiceTest, PagesThatCannotBeAreRefused) {
  v1::ListRigsResponse page;
  EXPECT_THAT(BadFields(List(-1, "", &page)), ElementsAre("page_size"));
  EXPECT_THAT(BadFields(List(5, "nonsense", &page)), ElementsAre("page_token"));
  EXPECT_THAT(BadFields(List(5, std::string(1 << 20, '\t'), &page)),
              ElementsAre("page_token"));
}

TEST_F(RigServiceTest, PageIsCutToWhatAClientReceivesByDefault) {
  // 50 settings of 800 bytes in each of 100 rigs: 4 MB in one page.
  Rig rig = TestRig("r");
  for (int i = 0; i < 50; ++i) {
    const std::string stars = "imu." + std::string(800, '*');
    rig.prior_sigmas.push_back({stars, 1.0});
  }
  for (int i = 0; i < 100; ++i) {
    rig.id = "r" + std::to_string(i);
    ASSERT_TRUE(domain_->CreateRig(rig).ok());
  }
  int rigs = 0;
  std::string token;
  do {
    v1::ListRigsResponse page;
    ASSERT_TRUE(List(1000, token, &page).ok());
    EXPECT_LT(page.ByteSizeLong(), 4u << 20);
    EXPECT_GT(page.rigs_size(), 0);
    rigs += page.rigs_size();
    token = page.next_page_token();
  } while (!token.empty() && rigs <= 100);
  EXPECT_EQ(rigs, 100);
}

TEST_F(RigServiceTest, UpdateChangesWhatTheMaskNamesAndNothingElse) {
  v1::Rig rig = ToProto(TestRig("r"));
  (*rig.mutable_labels())["batch"] = "7";
  ASSERT_TRUE(Create(rig).ok());
  v1::UpdateRigRequest request;
  request.mutable_rig()->set_name("rigs/r");
  request.mutable_rig()->set_min_gain_nats(3);
  request.mutable_rig()->set_retrigger_fraction(0.25);
  request.mutable_update_mask()->add_paths("min_gain_nats");
  v1::Rig updated;
  {
    Context context;
    const auto status = rigs_->UpdateRig(&context, request, &updated);
    ASSERT_TRUE(status.ok()) << status.error_message();
  }
  EXPECT_EQ(updated.min_gain_nats(), 3);
  EXPECT_EQ(updated.retrigger_fraction(), TestRig("r").retrigger_fraction);
  EXPECT_EQ(updated.labels().at("batch"), "7");
  // A field of the mask that is not set gets its default.
  request.mutable_rig()->clear_min_gain_nats();
  request.mutable_update_mask()->add_paths("labels");
  {
    Context context;
    ASSERT_TRUE(rigs_->UpdateRig(&context, request, &updated).ok());
  }
  EXPECT_EQ(updated.min_gain_nats(), 1);
  EXPECT_TRUE(updated.labels().empty());
  // Without a mask: what is set.
  request.clear_update_mask();
  {
    Context context;
    ASSERT_TRUE(rigs_->UpdateRig(&context, request, &updated).ok());
  }
  EXPECT_EQ(updated.retrigger_fraction(), 0.25);
  v1::Rig read;
  ASSERT_TRUE(Get("rigs/r", &read).ok());
  EXPECT_EQ(read.retrigger_fraction(), 0.25);
}

TEST_F(RigServiceTest, PriorMeanCanChangeInWhatTheRigEstimates) {
  ASSERT_TRUE(Create(ToProto(TestRig("r"))).ok());
  v1::UpdateRigRequest request;
  request.mutable_rig()->set_name("rigs/r");
  v1::CalibrationParameters* mean = request.mutable_rig()->mutable_prior_mean();
  *mean = ToProto(TestRig("r").factory);
  mean->mutable_cameras(0)->mutable_f()->set_x(mean->cameras(0).f().x() + 1);
  request.mutable_update_mask()->add_paths("prior_mean");
  request.set_reason("as its cohort");
  v1::Rig updated;
  {
    Context context;
    const auto status = rigs_->UpdateRig(&context, request, &updated);
    ASSERT_TRUE(status.ok()) << status.error_message();
  }
  v1::Rig read;
  ASSERT_TRUE(Get("rigs/r", &read).ok());
  EXPECT_EQ(read.prior_mean().cameras(0).f().x(), mean->cameras(0).f().x());
  EXPECT_EQ(read.factory().cameras(0).f().x(),
            TestRig("r").factory.cameras[0].f.x());
  const auto events = store_->ListNewestEvents({1, ""}, "r");
  EXPECT_THAT(events->items.at(0).detail, HasSubstr(": as its cohort"));
  // Its time offset is not estimated.
  mean->mutable_cameras(0)->set_time_offset_s(1e-3);
  {
    Context context;
    const auto status = rigs_->UpdateRig(&context, request, &updated);
    EXPECT_THAT(BadFields(status), ElementsAre("rig.prior_mean"));
    EXPECT_THAT(status.error_message(), HasSubstr("cam0.time_offset"));
  }
  mean->clear_cameras();
  request.set_reason("two\nlines");
  {
    Context context;
    EXPECT_THAT(BadFields(rigs_->UpdateRig(&context, request, &updated)),
                ElementsAre("reason"));
  }
  // Absent: the factory calibration again.
  request.mutable_rig()->clear_prior_mean();
  request.clear_reason();
  {
    Context context;
    ASSERT_TRUE(rigs_->UpdateRig(&context, request, &updated).ok());
  }
  EXPECT_FALSE(updated.has_prior_mean());
}

TEST_F(RigServiceTest, UpdateOfWhatCannotChangeSaysWhy) {
  ASSERT_TRUE(Create(ToProto(TestRig("r"))).ok());
  v1::UpdateRigRequest request;
  *request.mutable_rig() = ToProto(TestRig("r"));
  for (const char* path : {"factory", "groups", "imu_noise", "colour"}) {
    request.mutable_update_mask()->add_paths(path);
  }
  Context context;
  v1::Rig updated;
  const auto status = rigs_->UpdateRig(&context, request, &updated);
  EXPECT_THAT(BadFields(status),
              ElementsAre("update_mask.factory",
                          "update_mask.groups",
                          "update_mask.imu_noise",
                          "update_mask.colour"));
  EXPECT_THAT(status.error_message(), HasSubstr("versions never change"));
  Context missing;
  request.clear_update_mask();
  request.mutable_rig()->set_name("rigs/none");
  ExpectNotFound(rigs_->UpdateRig(&missing, request, &updated), "rigs/none");
}

TEST_F(RigServiceTest, LabelsFollowTheirRules) {
  v1::Rig rig = ToProto(TestRig("r"));
  (*rig.mutable_labels())["Batch"] = "7";
  EXPECT_THAT(BadFields(Create(rig)), ElementsAre("rig.labels"));
  rig.clear_labels();
  (*rig.mutable_labels())["batch"] = "two\nlines";
  EXPECT_THAT(BadFields(Create(rig)), ElementsAre("rig.labels.batch"));
  rig.clear_labels();
  for (int k = 0; k < 65; ++k) {
    (*rig.mutable_labels())["k" + std::to_string(k)] = "";
  }
  EXPECT_THAT(BadFields(Create(rig)), ElementsAre("rig.labels"));
}

TEST_F(RigServiceTest, ListIsFilteredAndSorted) {
  for (const char* id : {"phone-1", "phone-2", "tablet"}) {
    v1::Rig rig = ToProto(TestRig(id));
    (*rig.mutable_labels())["batch"] = id == std::string("phone-2") ? "8" : "7";
    ASSERT_TRUE(Create(rig).ok());
  }
  const auto list = [&](const std::string& filter,
                        const std::string& order_by) {
    Context context;
    v1::ListRigsRequest request;
    request.set_filter(filter);
    request.set_order_by(order_by);
    v1::ListRigsResponse response;
    const auto status = rigs_->ListRigs(&context, request, &response);
    std::vector<std::string> names;
    for (const v1::Rig& rig : response.rigs()) names.push_back(rig.name());
    if (!status.ok()) names = BadFields(status);
    return names;
  };
  EXPECT_THAT(list("labels.batch = 7", "name desc"),
              ElementsAre("rigs/tablet", "rigs/phone-1"));
  EXPECT_THAT(list("phone AND labels.batch = \"7\"", ""),
              ElementsAre("rigs/phone-1"));
  EXPECT_THAT(list("colour = red", ""), ElementsAre("filter"));
  EXPECT_THAT(list("", "colour"), ElementsAre("order_by"));
}

TEST_F(RigServiceTest, DeletedRigIsGone) {
  AddScored(1);
  v1::DeleteRigRequest request;
  request.set_name("rigs/r");
  google::protobuf::Empty nothing;
  {
    Context context;
    EXPECT_THAT(BadFields(rigs_->DeleteRig(&context, request, &nothing)),
                ElementsAre("reason"));
  }
  request.set_reason("sold");
  {
    Context context;
    const auto status = rigs_->DeleteRig(&context, request, &nothing);
    ASSERT_TRUE(status.ok()) << status.error_message();
  }
  v1::Rig read;
  ExpectNotFound(Get("rigs/r", &read), "rigs/r");
  Context context;
  ExpectNotFound(rigs_->DeleteRig(&context, request, &nothing), "rigs/r");
}

TEST_F(RigServiceTest, WatchesOfADeletedRigEnd) {
  AddRig("r");
  AddRig("s");
  const auto deadline =
      std::chrono::system_clock::now() + std::chrono::seconds(20);
  Context contexts[3];
  for (Context& context : contexts) context.set_deadline(deadline);
  v1::WatchCalibrationRequest of_versions;
  of_versions.set_parent("rigs/r");
  const auto versions =
      calibrations_->WatchCalibration(&contexts[0], of_versions);
  v1::Calibration version;
  ASSERT_TRUE(versions->Read(&version));
  const auto activity = v1::ActivityService::NewStub(channel_);
  v1::WatchChangesRequest of_changes;
  of_changes.set_parent("rigs/r");
  const auto changes = activity->WatchChanges(&contexts[1], of_changes);
  v1::Change change;
  ASSERT_TRUE(changes->Read(&change));
  of_versions.set_parent("rigs/s");
  const auto others =
      calibrations_->WatchCalibration(&contexts[2], of_versions);
  ASSERT_TRUE(others->Read(&version));

  v1::DeleteRigRequest request;
  request.set_name("rigs/r");
  request.set_reason("sold");
  google::protobuf::Empty nothing;
  Context context;
  ASSERT_TRUE(rigs_->DeleteRig(&context, request, &nothing).ok());
  while (versions->Read(&version)) {
  }
  const grpc::Status ended = versions->Finish();
  ExpectNotFound(ended, "rigs/r");
  EXPECT_THAT(ended.error_message(), HasSubstr("deleted"));
  while (changes->Read(&change)) {
  }
  ExpectNotFound(changes->Finish(), "rigs/r");
  // That of another rig goes on.
  contexts[2].TryCancel();
  EXPECT_EQ(others->Finish().error_code(), grpc::StatusCode::CANCELLED);
}

}  // namespace
}  // namespace selfcal::server
