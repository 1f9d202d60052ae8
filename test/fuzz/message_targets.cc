#include <google/protobuf/stubs/logging.h>

#include <exception>

#include "core/information/segment_information.h"
#include "core/simulation/simulate.h"
#include "proto/convert.h"
#include "selfcal/v1/rig.pb.h"
#include "selfcal/v1/segment.pb.h"
#include "test/fuzz/targets.h"

namespace selfcal {
namespace {

// Scoring more takes a fuzzer's time and shows nothing new.
constexpr std::size_t kMaxScored = 2000;  // keyframes, samples, observations

bool IsSmall(const MotionSegment& segment) {
  return segment.keyframes.size() + segment.imu.size() +
             segment.observations.size() <=
         kMaxScored;
}

template <typename Message>
bool Parse(std::string_view bytes, Message* message) {
  const google::protobuf::LogSilencer silent;  // of strings that are no UTF-8
  return message->ParseFromArray(bytes.data(), static_cast<int>(bytes.size()));
}

}  // namespace

void FuzzSegment(std::string_view bytes) {
  static const Rig rig = HandheldRig("fuzzed");
  v1::StreamSegmentsRequest request;
  if (!Parse(bytes, &request)) return;
  MotionSegment segment;
  if (!FromProto(request.segment(), "", &segment).empty()) return;
  if (!Validate(segment, rig.factory).empty() || !IsSmall(segment)) return;
  MotionSegment again;
  FuzzCheck(FromProto(ToProto(segment), "", &again).empty(),
            "a valid segment can be sent on");
  try {
    const SegmentInformation information =
        ScoreSegment(rig, rig.factory, segment);
    FuzzCheck(information.Lambda.allFinite() && information.eta.allFinite(),
              "information is finite");
    for (const GroupScore& score : information.groups) {
      FuzzCheck(score.gain >= 0, "a gain is not negative");
    }
  } catch (const std::exception&) {
    // The pipeline sets such a segment aside.
  }
}

void FuzzRig(std::string_view bytes) {
  v1::Rig message;
  if (!Parse(bytes, &message)) return;
  Rig rig;
  if (!FromProto(message, "", &rig).empty() || !Validate(rig).empty()) return;
  Rig again;
  FuzzCheck(FromProto(ToProto(rig), "", &again).empty(),
            "a valid rig can be sent on");
  FuzzCheck(PriorSigmas(rig).size() == TangentSize(rig.factory),
            "every component has a prior");
}

}  // namespace selfcal
