// Encodes sessions, exclusions and residuals as messages of the console.
#pragma once

#include <string>
#include <vector>

#include "core/information/segment_information.h"
#include "core/information/segment_residuals.h"
#include "core/model/rig.h"
#include "core/model/segment.h"
#include "server/console/motion.pb.h"
#include "server/store/store.h"

namespace selfcal::server {

console::SessionOverview Encode(const std::string& rig,
                                const SessionSummary& session);

// Encodes a segment with at most this many positions, including the first and
// the last.
console::SessionPiece Encode(const std::string& rig,
                             const SessionSegment& segment,
                             int max_points);

console::Absence Encode(const std::string& rig, const TableAbsence& absence);

// Encodes the information of one segment together with the prior of the rig
// (core/information/fusion.h).
console::SegmentInformation Encode(const Rig& rig,
                                   const SegmentInformation& information);

console::SegmentResiduals Encode(const SegmentResiduals& residuals,
                                 const MotionSegment& segment,
                                 int cameras);

}  // namespace selfcal::server
