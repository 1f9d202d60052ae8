// Sessions, and what single segments tell, as messages of the contract.
#pragma once

#include <string>

#include "core/information/segment_information.h"
#include "core/information/segment_residuals.h"
#include "core/model/rig.h"
#include "core/model/segment.h"
#include "selfcal/v1/segment.pb.h"
#include "selfcal/v1/session.pb.h"
#include "server/store/store.h"

namespace selfcal::server {

v1::Session Encode(const std::string& rig, const SessionSummary& session);

// With at most `max_points` positions, the first and the last among them.
v1::TrajectorySegment Encode(const std::string& rig,
                             const SessionSegment& segment,
                             int max_points);

// Standard deviation of each component without and with the segment, given the
// prior of the rig (core/information/fusion.h).
v1::SegmentInformation Encode(const Rig& rig,
                              const SegmentInformation& information);

v1::SegmentResiduals Encode(const SegmentResiduals& residuals,
                            const MotionSegment& segment,
                            int cameras);

}  // namespace selfcal::server
