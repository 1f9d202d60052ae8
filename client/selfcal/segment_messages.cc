#include "client/selfcal/segment_messages.h"

#include <fmt/format.h>

#include <algorithm>

#include "proto/convert.h"
#include "proto/resource_names.h"

namespace selfcal::client {

std::vector<Violation> MakeRequest(const std::string& rig,
                                   const MotionSegment& segment,
                                   v1::StreamSegmentsRequest* request) {
  const std::string& session = segment.key.session;
  if (session.size() > kMaxSessionBytes) {
    return {{"session", fmt::format("has {} characters", session.size())}};
  }
  if (std::any_of(session.begin(), session.end(), [](char c) {
        return c < ' ' || c > '~';
      })) {
    return {{"session", "has a character that is not printable ASCII"}};
  }
  request->set_parent(RigName(rig));
  *request->mutable_segment() = ToProto(segment);
  const std::size_t bytes = request->ByteSizeLong();
  if (bytes > kMaxRequestBytes) {
    return {{"segment",
             fmt::format("takes {} bytes, at most {} can be sent; make shorter "
                         "segments",
                         bytes,
                         kMaxRequestBytes)}};
  }
  return {};
}

Acknowledgement ToAcknowledgement(const v1::StreamSegmentsResponse& response) {
  using Response = v1::StreamSegmentsResponse;
  Acknowledgement ack;
  ack.key = {response.session(), response.index()};
  ack.observations_dropped =
      static_cast<std::uint64_t>(std::max(response.observations_dropped(), 0));
  ack.readings_dropped =
      static_cast<std::uint64_t>(std::max(response.readings_dropped(), 0));
  for (const v1::FieldViolation& violation : response.violations()) {
    ack.violations.push_back({violation.field(), violation.description()});
  }
  switch (response.verdict()) {
    case Response::STORED:
      ack.verdict = Acknowledgement::Verdict::kStored;
      break;
    case Response::DUPLICATE:
      ack.verdict = Acknowledgement::Verdict::kDuplicate;
      break;
    case Response::REJECTED:
      ack.verdict = Acknowledgement::Verdict::kRejected;
      break;
    default:
      // Must not be treated as stored, and sending again would not help.
      ack.verdict = Acknowledgement::Verdict::kRejected;
      ack.violations.push_back(
          {"verdict", "is not known to this client; update it"});
  }
  return ack;
}

}  // namespace selfcal::client
