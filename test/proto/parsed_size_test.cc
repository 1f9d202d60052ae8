#include "proto/parsed_size.h"

#include <google/protobuf/io/zero_copy_stream_impl_lite.h>
#include <gtest/gtest.h>

#include <cstdint>
#include <string>

#include "proto/convert.h"
#include "selfcal/v1/rig.pb.h"
#include "selfcal/v1/segment.pb.h"
#include "selfcal/v1/uplink.pb.h"
#include "test/proto/random_values.h"

namespace selfcal {
namespace {

template <class Message>
std::int64_t SizeOf(const std::string& bytes) {
  google::protobuf::io::ArrayInputStream stream(bytes.data(),
                                                static_cast<int>(bytes.size()));
  return ParsedSize(*Message::descriptor(), &stream);
}

template <class Message>
std::int64_t Actual(const std::string& bytes) {
  Message message;
  EXPECT_TRUE(message.ParseFromString(bytes));
  return static_cast<std::int64_t>(message.SpaceUsedLong());
}

std::string Repeated(const std::string& bytes, int count) {
  std::string all;
  for (int i = 0; i < count; ++i) all += bytes;
  return all;
}

// A rig within a request, of which only the cameras are there: empty ones.
std::string EmptyCameras(int count) {
  v1::CreateRigRequest request;
  for (int i = 0; i < count; ++i) {
    request.mutable_rig()->mutable_factory()->add_cameras();
  }
  return request.SerializeAsString();
}

TEST(ParsedSize, IsAtLeastWhatTheMessageTakes) {
  RandomValues random(1);
  for (int i = 0; i < 100; ++i) {
    const std::string segment = ToProto(random.Segment()).SerializeAsString();
    EXPECT_GE(SizeOf<v1::MotionSegment>(segment),
              Actual<v1::MotionSegment>(segment));
    const std::string rig = ToProto(random.RigValue()).SerializeAsString();
    EXPECT_GE(SizeOf<v1::Rig>(rig), Actual<v1::Rig>(rig));
  }
  for (const int count : {0, 1, 1000}) {
    v1::Rig labelled;
    for (int i = 0; i < count; ++i) {
      (*labelled.mutable_labels())["label" + std::to_string(i)] = "value";
    }
    const std::string labels = labelled.SerializeAsString();
    EXPECT_GE(SizeOf<v1::Rig>(labels), Actual<v1::Rig>(labels));
    const std::string cameras = EmptyCameras(count);
    EXPECT_GE(SizeOf<v1::CreateRigRequest>(cameras),
              Actual<v1::CreateRigRequest>(cameras));
    v1::ReportRequest report;
    report.set_records(std::string(count, 'x'));
    for (int i = 0; i < count; ++i) report.add_results();
    const std::string bytes = report.SerializeAsString();
    EXPECT_GE(SizeOf<v1::ReportRequest>(bytes),
              Actual<v1::ReportRequest>(bytes));
    v1::MotionSegment zeros;
    for (int i = 0; i < count; ++i) {
      zeros.mutable_observations()->add_keyframe(0);
      zeros.mutable_keyframes()->add_t_ns(0);
    }
    const std::string numbers = zeros.SerializeAsString();
    EXPECT_GE(SizeOf<v1::MotionSegment>(numbers),
              Actual<v1::MotionSegment>(numbers));
  }
}

TEST(ParsedSize, FieldsThatAreNotKnownCount) {
  // Numbers, fixed ones, strings, a group.
  for (const std::string& field : {std::string("\xf8\x07\x01", 3),
                                   std::string("\xfd\x07\0\0\0\0", 6),
                                   std::string("\xf9\x07\0\0\0\0\0\0\0\0", 10),
                                   std::string("\xfa\x07\0", 3),
                                   std::string("\xfb\x07\xfc\x07", 4)}) {
    const std::string bytes = Repeated(field, 1000);
    EXPECT_GE(SizeOf<v1::GetRigRequest>(bytes),
              Actual<v1::GetRigRequest>(bytes));
    // The same in a message within.
    v1::CreateRigRequest request;
    EXPECT_TRUE(request.mutable_rig()->ParseFromString(bytes));
    const std::string within = request.SerializeAsString();
    EXPECT_GE(SizeOf<v1::CreateRigRequest>(within),
              Actual<v1::CreateRigRequest>(within));
  }
}

// Protobuf keeps fields of another form than the contract's, and those in
// groups, as unknown ones.
TEST(ParsedSize, FieldsOfAnotherFormCount) {
  // CreateRigRequest.rig and Rig.name (both 1) as numbers, fixed ones and
  // groups; GetRigRequest.name in a group.
  for (const std::string& field : {std::string("\x08\x01", 2),
                                   std::string("\x0d\0\0\0\0", 5),
                                   std::string("\x09\0\0\0\0\0\0\0\0", 9),
                                   std::string("\x0b\x0c", 2),
                                   std::string("\x7b\x0a\0\x0a\0\x7c", 6)}) {
    const std::string bytes = Repeated(field, 1000);
    EXPECT_GE(SizeOf<v1::CreateRigRequest>(bytes),
              Actual<v1::CreateRigRequest>(bytes));
    EXPECT_GE(SizeOf<v1::GetRigRequest>(bytes),
              Actual<v1::GetRigRequest>(bytes));
    // The bytes, not only the message without its fields.
    EXPECT_GE(Actual<v1::GetRigRequest>(bytes), 16'000);
  }
}

// Otherwise a segment would wait for memory that it does not need.
TEST(ParsedSize, OfASegmentIsBelowFourTimesItsBytes) {
  RandomValues random(2);
  for (int i = 0; i < 100; ++i) {
    const std::string segment = ToProto(random.Segment()).SerializeAsString();
    EXPECT_LE(SizeOf<v1::MotionSegment>(segment),
              4 * static_cast<std::int64_t>(segment.size()) + 2000);
  }
}

// Whatever the bytes, it ends, and reads nothing beyond them.
TEST(ParsedSize, OfAnythingElseIsThatOfWhatCanBeRead) {
  // The last field may claim any length that a message can have, of numbers
  // that take 16 bytes each; what comes before it takes less than this for each
  // of its bytes.
  constexpr std::int64_t kLongestField = std::int64_t{16} << 31;
  constexpr std::int64_t kOfOneByte = 1000;
  RandomValues random(3);
  const std::string good = ToProto(random.Segment()).SerializeAsString();
  const std::int64_t whole = SizeOf<v1::MotionSegment>(good);
  const std::int64_t empty = Actual<v1::MotionSegment>("");
  for (int i = 0; i < 2000; ++i) {
    std::string bytes = good.substr(0, random.Int(0, 400));
    const std::int64_t cut = SizeOf<v1::MotionSegment>(bytes);
    EXPECT_GE(cut, empty);
    EXPECT_LE(cut, whole);
    if (bytes.empty()) continue;
    bytes[random.Int(0, static_cast<int>(bytes.size()) - 1)] =
        static_cast<char>(random.Int(0, 255));
    const std::int64_t damaged = SizeOf<v1::MotionSegment>(bytes);
    EXPECT_GE(damaged, empty);
    EXPECT_LE(damaged,
              empty + kOfOneByte * static_cast<std::int64_t>(bytes.size()) +
                  kLongestField);
  }
  // Deeper than protobuf reads. Each of the groups that are not known is an
  // UnknownField and an UnknownFieldSet.
  std::string deep;
  for (int i = 0; i < 1000; ++i) deep = Repeated("\x7b", 1) + deep + "\x7c";
  EXPECT_GE(SizeOf<v1::GetRigRequest>(deep), 1000 * (16 + 24));
  EXPECT_LE(SizeOf<v1::GetRigRequest>(deep),
            kOfOneByte * static_cast<std::int64_t>(deep.size()));
}

}  // namespace
}  // namespace selfcal
