#include "client/selfcal/encoded_segment.h"

#include <utility>

#include "client/selfcal/segment_messages.h"

namespace selfcal::client {

std::variant<EncodedSegment, Acknowledgement> Encode(
    const std::string& rig,
    UnencodedSegment segment,
    AssemblyStatistics* statistics) {
  if (const auto* closed = std::get_if<ClosedSegment>(&segment)) {
    segment = Assemble(*closed, statistics);
  }
  const auto& assembled = std::get<MotionSegment>(segment);
  auto request = std::make_shared<v1::StreamSegmentsRequest>();
  auto violations = MakeRequest(rig, assembled, request.get());
  if (!violations.empty()) {
    return Acknowledgement{assembled.key,
                           Acknowledgement::Verdict::kRejected,
                           std::move(violations)};
  }
  return EncodedSegment{0, assembled.key, std::move(request), false};
}

}  // namespace selfcal::client
