// Malformed segments through a real daemon: each is refused with the field that
// is at fault, and the stream goes on.
#include <gmock/gmock.h>
#include <grpcpp/create_channel.h>

#include <functional>
#include <limits>

#include "proto/convert.h"
#include "selfcal/v1/segment.grpc.pb.h"
#include "test/support/eventually.h"
#include "test/system/running_daemon.h"
#include "test/system/simulated_walk.h"

namespace selfcal::client {
namespace {

using Response = v1::StreamSegmentsResponse;
using Request = v1::StreamSegmentsRequest;

struct Damage {
  std::string name;
  std::string field;  // that the refusal must name
  std::function<void(Request*)> apply;
};

v1::MotionSegment::Keyframes* Keyframes(Request* request) {
  return request->mutable_segment()->mutable_keyframes();
}

v1::MotionSegment::Observations* Observations(Request* request) {
  return request->mutable_segment()->mutable_observations();
}

std::vector<Damage> DamagesOfValues() {
  return {
      {"quaternion of norm 0.9",
       "keyframes[3].q_gi",
       [](Request* r) {
         for (int i = 12; i < 16; ++i) {
           Keyframes(r)->set_q_gi(i, 0.9 * Keyframes(r)->q_gi(i));
         }
       }},
      {"keyframes out of order",
       "keyframes[5].t_ns",
       [](Request* r) { Keyframes(r)->mutable_t_ns()->SwapElements(4, 5); }},
      {"IMU samples out of order",
       "imu[7].t_ns",
       [](Request* r) {
         r->mutable_segment()->mutable_imu()->mutable_t_ns()->SwapElements(6,
                                                                           7);
       }},
      {"landmark that is not there",
       "observations[2].landmark",
       [](Request* r) {
         Observations(r)->set_landmark(2, r->segment().landmarks().id_size());
       }},
      {"camera that is not there",
       "observations[2].camera",
       [](Request* r) { Observations(r)->set_camera(2, 1); }},
      {"pixel that is not a number",
       "observations[4].z_px",
       [](Request* r) {
         Observations(r)->set_z_px(9, std::numeric_limits<double>::quiet_NaN());
       }},
      {"calibration version that does not exist",
       "calibration_version",
       [](Request* r) { r->mutable_segment()->set_calibration_version(99); }}};
}

std::vector<Damage> DamagesOfShape() {
  return {
      {"short column of quaternions",
       "keyframes.q_gi",
       [](Request* r) { Keyframes(r)->mutable_q_gi()->RemoveLast(); }},
      {"short column of pixels",
       "observations.z_px",
       [](Request* r) { Observations(r)->mutable_z_px()->RemoveLast(); }},
      {"long column of readings",
       "imu.gyro",
       [](Request* r) { r->mutable_segment()->mutable_imu()->add_gyro(0); }},
      {"no keyframes at all",
       "keyframes",
       [](Request* r) { r->mutable_segment()->clear_keyframes(); }},
      {"another rig in mid-stream",
       "parent",
       [](Request* r) { r->set_parent("rigs/other"); }},
      {"rig that does not exist in mid-stream", "parent", [](Request* r) {
         r->set_parent("rigs/nobody");
       }}};
}

class MalformedStream : public ::testing::Test {
 protected:
  void SetUp() override {
    ASSERT_TRUE(view_.CreateRig(device_.rig).ok());
    Rig other = device_.rig;
    other.id = "other";
    ASSERT_TRUE(DaemonView(folder_.target(), "other").CreateRig(other).ok());
  }

  Request MakeRequest(int index) const {
    Request request;
    request.set_parent("rigs/walker");
    *request.mutable_segment() = ToProto(device_.segments[index]);
    return request;
  }

  // Sends a good segment, then for each damage the next segment with it and
  // once more without.
  void ExpectEachRefusedAndTheNextStored(const std::vector<Damage>& damages);

  const Device device_ = SimulateWalk("walker", 10, 21);
  const ScratchFolder folder_;
  const std::unique_ptr<DaemonProcess> daemon_ = folder_.StartDaemon();
  DaemonView view_{folder_.target(), "walker"};
  const std::unique_ptr<v1::SegmentService::Stub> stub_ =
      v1::SegmentService::NewStub(grpc::CreateChannel(
          folder_.target(), grpc::InsecureChannelCredentials()));
};

void MalformedStream::ExpectEachRefusedAndTheNextStored(
    const std::vector<Damage>& damages) {
  ASSERT_LT(damages.size(), device_.segments.size());
  grpc::ClientContext context;
  const auto stream = stub_->StreamSegments(&context);
  const auto exchange = [&](const Request& request) {
    Response response;
    EXPECT_TRUE(stream->Write(request));
    EXPECT_TRUE(stream->Read(&response));
    return response;
  };
  ASSERT_EQ(exchange(MakeRequest(0)).verdict(), Response::STORED);
  for (std::size_t i = 0; i < damages.size(); ++i) {
    SCOPED_TRACE(damages[i].name);
    Request damaged = MakeRequest(static_cast<int>(i) + 1);
    damages[i].apply(&damaged);
    const Response refused = exchange(damaged);
    EXPECT_EQ(refused.verdict(), Response::REJECTED);
    std::vector<std::string> fields;
    for (const v1::FieldViolation& violation : refused.violations()) {
      fields.push_back(violation.field());
      EXPECT_FALSE(violation.description().empty());
    }
    EXPECT_THAT(fields, ::testing::Contains(damages[i].field));
    EXPECT_EQ(exchange(MakeRequest(static_cast<int>(i) + 1)).verdict(),
              Response::STORED);
  }
  stream->WritesDone();
  EXPECT_TRUE(stream->Finish().ok());
  // Nothing but the good ones, and the daemon can use them.
  ASSERT_TRUE(WaitUntilIdle(view_, damages.size() + 1, kLongWait).ok());
  const auto state = view_.GetState();
  ASSERT_TRUE(state.ok());
  for (const v1::Segment& segment : state->segments) {
    EXPECT_EQ(segment.state(), v1::Segment::SCORED) << segment.problem();
  }
  EXPECT_TRUE(
      DaemonView(folder_.target(), "other").GetState()->segments.empty());
}

TEST_F(MalformedStream, WrongValuesAreRefusedByField) {
  ExpectEachRefusedAndTheNextStored(DamagesOfValues());
}

TEST_F(MalformedStream, WrongShapesAreRefusedByField) {
  ExpectEachRefusedAndTheNextStored(DamagesOfShape());
}

TEST_F(MalformedStream, AnUnknownRigEndsTheStreamWithItsName) {
  grpc::ClientContext context;
  const auto stream = stub_->StreamSegments(&context);
  Request request = MakeRequest(0);
  request.set_parent("rigs/nobody");
  stream->Write(request);
  Response response;
  EXPECT_FALSE(stream->Read(&response));
  const grpc::Status status = stream->Finish();
  EXPECT_EQ(status.error_code(), grpc::StatusCode::NOT_FOUND);
  EXPECT_THAT(status.error_message(), ::testing::HasSubstr("nobody"));
}

}  // namespace
}  // namespace selfcal::client
