// Records that remain of the segments of a session: the path of the device, the
// scores, and why a table does not hold a segment.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/model/segment.h"
#include "server/store/exclusion_cause.h"
#include "server/store/segment_query.h"

namespace selfcal::server {

struct SessionSummary {
  std::string session;
  std::int64_t segments = 0;  // that have records
  std::int64_t first_receive_ns = 0;
  std::int64_t last_receive_ns = 0;
};

// Rounded to floats: for display, not for estimation.
struct PathPoint {
  float seconds = 0;  // since the first keyframe of the segment
  Eigen::Vector3f p_GI = Eigen::Vector3f::Zero();  // [m]

  friend bool operator==(const PathPoint&, const PathPoint&) = default;
};

// A segment of a session, with its path.
struct SessionSegment {
  SegmentKey key;
  SegmentState state = SegmentState::kStored;
  bool has_data = false;
  std::int64_t start_ns = 0;  // clock of the session
  std::int64_t end_ns = 0;
  // At most kMaxPathPoints keyframes, the first and the last among them. Empty
  // for a segment from before paths were stored, and for a damaged record.
  std::vector<PathPoint> path;
  struct Score {
    std::string group;
    double entropy = 0;  // [nat]; NaN if not a number
    double gain = 0;
  };
  std::vector<Score> scores;        // ordered by group
  std::vector<std::string> tables;  // groups that hold it
};

inline constexpr int kMaxPathPoints = 16;

// An exclusion: why the table of a group does not hold a scored segment.
struct Exclusion {
  std::string group;
  ExclusionCause cause = ExclusionCause::kInsufficientGain;
  std::int64_t time_ns = 0;
  // kOutranked: the worst entry of the table at that time; kReplaced: the
  // segment that replaced it. No key once the records of that segment are gone.
  std::optional<SegmentKey> rival;
  std::optional<double> rival_entropy;  // [nat]
  // kDoesNotFit: ResidualStatistics::fit, and the largest that is admitted.
  std::optional<double> fit;
  std::optional<double> fit_limit;
};

}  // namespace selfcal::server
