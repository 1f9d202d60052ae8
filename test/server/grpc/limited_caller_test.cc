// A caller whose role is on some rigs sees these alone: in every list, filter
// and watch.
#include "selfcal/v1/activity_service.grpc.pb.h"
#include "test/server/grpc/methods.h"
#include "test/server/grpc/service_test.h"
#include "test/support/certificates.h"

namespace selfcal::server {
namespace {

using std::chrono::milliseconds;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr milliseconds kAnswered{20'000};
constexpr char kShown[] = "shown-4711";
constexpr char kHidden[] = "hidden-0815";

class LimitedCallerTest : public ServiceTest {
 protected:
  LimitedCallerTest() {
    const std::string role = "URI:selfcal://role/";
    certificates_.Add("all", "ca", role + "administer");
    certificates_.Add("label", "ca", role + "administer/labels/site/north");
    certificates_.Add("rig", "ca", role + "read/rigs/" + kShown);
    certificates_.Add("elsewhere", "ca", role + "read/labels/site/east");
    Fill(kShown, "north");
    Fill(kHidden, "south");
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

  // A rig with a segment, a run, versions and events.
  void Fill(const std::string& id, const std::string& site) {
    const Rig rig = TestRig(id);
    ASSERT_TRUE(domain_->CreateRig(rig).ok());
    SetSite(id, site);
    const MotionSegment segment = TestSegments(rig, 1)[0];
    ASSERT_TRUE(domain_->PutSegment(id, segment).ok());
    Score(rig, segment.key, 1.0);
    const auto run = domain_->CreateManualRun(id, true);
    ASSERT_TRUE(run.ok()) << run.status();
    FinishRun(rig, run->run);
  }

  void SetSite(const std::string& id, const std::string& site) {
    const auto updated = domain_->UpdateRig(
        id,
        [&](StoredRig rig) -> absl::StatusOr<StoredRig> {
          rig.labels["site"] = site;
          return rig;
        },
        "test");
    ASSERT_TRUE(updated.ok()) << updated.status();
  }

  std::shared_ptr<grpc::Channel> As(const std::string& name) {
    grpc::ChannelArguments arguments;
    arguments.SetInt("test.channel", ++channels_);
    return grpc::CreateCustomChannel(tls_server_->addresses()[0],
                                     certificates_.Client(name, "ca"),
                                     arguments);
  }

  // What the method answers, as text.
  std::string Ask(const std::string& name,
                  const MethodDescriptor& method,
                  const google::protobuf::Message& request) {
    std::vector<std::string> responses;
    const grpc::Status status =
        CallWith(As(name), method, request, kAnswered, &responses);
    EXPECT_TRUE(status.ok()) << method.full_name() << " as " << name << ": "
                             << status.error_message();
    std::string text;
    for (const std::string& bytes : responses) {
      const std::unique_ptr<google::protobuf::Message> response(
          google::protobuf::MessageFactory::generated_factory()
              ->GetPrototype(method.output_type())
              ->New());
      EXPECT_TRUE(response->ParseFromString(bytes));
      text += response->DebugString();
    }
    return text;
  }

  static std::vector<const MethodDescriptor*> Lists() {
    return MethodsThat([](const MethodDescriptor& method) {
      return IsLimitedToRights(method) && !method.server_streaming();
    });
  }

  // A request for the whole list, on one page.
  static std::unique_ptr<google::protobuf::Message> Whole(
      const MethodDescriptor& list) {
    auto request = RequestFor(list, "");
    const auto* size = request->GetDescriptor()->FindFieldByName("page_size");
    if (size != nullptr) {
      request->GetReflection()->SetInt32(request.get(), size, 1000);
    }
    return request;
  }

  Certificates certificates_;
  std::unique_ptr<Server> tls_server_;

 private:
  int channels_ = 0;
};

TEST_F(LimitedCallerTest, EveryListIsOfTheRigsOfTheCaller) {
  const auto lists = Lists();
  EXPECT_GE(lists.size(), 8u);
  for (const MethodDescriptor* list : lists) {
    const auto request = Whole(*list);
    // The rigs are there to be seen.
    EXPECT_THAT(Ask("all", *list, *request),
                list->name() == "DescribeCohort" ? HasSubstr("rigs: 2")
                                                 : HasSubstr(kHidden))
        << list->full_name();
    for (const std::string caller : {"label", "rig"}) {
      const std::string answer = Ask(caller, *list, *request);
      EXPECT_THAT(answer, HasSubstr(kShown)) << list->full_name();
      EXPECT_THAT(answer, Not(HasSubstr(kHidden))) << list->full_name();
    }
    if (list->name() != "DescribeCohort") {  // NOT_FOUND without a rig
      EXPECT_THAT(Ask("elsewhere", *list, *request),
                  Not(::testing::ContainsRegex("shown|hidden")))
          << list->full_name();
    }
  }
}

TEST_F(LimitedCallerTest, FilterFindsNoOtherRig) {
  for (const MethodDescriptor* list : Lists()) {
    if (list->name() == "DescribeCohort") continue;
    const auto request = Whole(*list);
    const auto* field = request->GetDescriptor()->FindFieldByName("rig_filter");
    if (field == nullptr) {
      field = request->GetDescriptor()->FindFieldByName("filter");
    }
    ASSERT_NE(field, nullptr) << list->full_name();
    for (const std::string& filter : {std::string("name = ") + kHidden,
                                      std::string("labels.site = south")}) {
      request->GetReflection()->SetString(request.get(), field, filter);
      EXPECT_THAT(Ask("all", *list, *request), HasSubstr(kHidden))
          << list->full_name();
      EXPECT_THAT(Ask("label", *list, *request),
                  Not(::testing::ContainsRegex("shown|hidden")))
          << list->full_name();
    }
  }
}

TEST_F(LimitedCallerTest, RightsFollowTheLabels) {
  const auto rigs = [&] {
    v1::ListRigsResponse response;
    Context context;
    EXPECT_TRUE(v1::RigService::NewStub(As("label"))
                    ->ListRigs(&context, {}, &response)
                    .ok());
    std::set<std::string> names;
    for (const auto& rig : response.rigs()) names.insert(rig.name());
    return names;
  };
  const auto get = [&](const std::string& id) {
    Context context;
    v1::GetRigRequest request;
    request.set_name("rigs/" + id);
    v1::Rig response;
    return v1::RigService::NewStub(As("label"))
        ->GetRig(&context, request, &response)
        .error_code();
  };
  EXPECT_EQ(get(kShown), grpc::StatusCode::OK);
  EXPECT_EQ(get(kHidden), grpc::StatusCode::PERMISSION_DENIED);
  EXPECT_EQ(get("no-such-rig"), grpc::StatusCode::PERMISSION_DENIED);
  SetSite(kShown, "west");
  EXPECT_EQ(get(kShown), grpc::StatusCode::PERMISSION_DENIED);
  EXPECT_EQ(rigs(), std::set<std::string>());
  SetSite(kHidden, "north");
  EXPECT_EQ(get(kHidden), grpc::StatusCode::OK);
  EXPECT_EQ(rigs(), std::set<std::string>{std::string("rigs/") + kHidden});
}

TEST_F(LimitedCallerTest, WatchTellsOfTheRigsOfTheCallerAlone) {
  Context context;
  context.set_deadline(std::chrono::system_clock::now() + kAnswered);
  const auto stub = v1::ActivityService::NewStub(As("label"));
  const auto watch = stub->WatchChanges(&context, {});
  v1::Change change;
  ASSERT_TRUE(watch->Read(&change));
  EXPECT_EQ(change.what(), v1::Change::EVERYTHING);
  // The feed looks for events of callers; both rigs have some now.
  SetSite(kHidden, "far");
  SetSite(kShown, "north");
  const auto updated = domain_->UpdateRig(
      kShown,
      [](StoredRig rig) -> absl::StatusOr<StoredRig> {
        rig.labels["seen"] = "yes";
        return rig;
      },
      "test");
  ASSERT_TRUE(updated.ok()) << updated.status();
  bool shown = false;
  while (!shown && watch->Read(&change)) {
    EXPECT_THAT(change.rig(), Not(HasSubstr(kHidden)));
    shown = change.rig() == std::string("rigs/") + kShown;
  }
  EXPECT_TRUE(shown);
  context.TryCancel();
}

// It does not get what it has not been sent by then.
TEST_F(LimitedCallerTest, AWatchEndsOnceItsRigHasLostTheLabel) {
  Context context;
  context.set_deadline(std::chrono::system_clock::now() + kAnswered);
  v1::WatchCalibrationRequest request;
  request.set_parent(std::string("rigs/") + kShown);
  const auto stub = v1::CalibrationService::NewStub(As("label"));
  const auto watch = stub->WatchCalibration(&context, request);
  v1::Calibration update;
  ASSERT_TRUE(watch->Read(&update));
  const auto publish = [&] {
    const auto run = domain_->CreateManualRun(kShown, true);
    ASSERT_TRUE(run.ok()) << run.status();
    pipeline_->Publish(FinishRun(TestRig(kShown), run->run));
  };
  publish();
  ASSERT_TRUE(watch->Read(&update));
  SetSite(kShown, "west");
  publish();
  EXPECT_FALSE(watch->Read(&update));
  EXPECT_EQ(watch->Finish().error_code(), grpc::StatusCode::PERMISSION_DENIED);
}

TEST_F(LimitedCallerTest, AStreamEndsOnceItsRigHasLostTheLabel) {
  Context context;
  context.set_deadline(std::chrono::system_clock::now() + kAnswered);
  const auto stub = v1::SegmentService::NewStub(As("label"));
  const auto stream = stub->StreamSegments(&context);
  const std::vector<MotionSegment> segments = TestSegments(TestRig(kShown), 3);
  v1::StreamSegmentsResponse response;
  const auto send = [&](std::size_t s, const std::string& parent) {
    v1::StreamSegmentsRequest message;
    message.set_parent(parent);
    *message.mutable_segment() = ToProto(segments[s]);
    return stream->Write(message) && stream->Read(&response);
  };
  ASSERT_TRUE(send(1, std::string("rigs/") + kShown));
  SetSite(kShown, "west");
  // Even if it does not name its rig again.
  EXPECT_FALSE(send(2, ""));
  EXPECT_EQ(stream->Finish().error_code(), grpc::StatusCode::PERMISSION_DENIED);
  EXPECT_TRUE(
      absl::IsNotFound(store_->GetSegment(kShown, segments[2].key).status()));
}

}  // namespace
}  // namespace selfcal::server
