// What is kept of every segment for whoever looks back at a session: where the
// device went, what each piece said, and why a table does not hold it.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/model/segment.h"

namespace selfcal::server {

// kUnusable: its data is damaged or cannot be scored, or it is quarantined: a
// run has found that it contradicts the others, or an operator has. Its problem
// says why; its information enters nothing any more.
enum class SegmentState { kStored, kScored, kUnusable };

struct SessionSummary {
  std::string session;
  std::int64_t segments = 0;  // that are known
  std::int64_t first_receive_ns = 0;
  std::int64_t last_receive_ns = 0;
};

// Rounded to floats: for pictures, not for estimates.
struct PathPoint {
  float seconds = 0;  // since the first keyframe of the segment
  Eigen::Vector3f p_GI = Eigen::Vector3f::Zero();  // [m]

  friend bool operator==(const PathPoint&, const PathPoint&) = default;
};

// A piece of the way of a session.
struct SessionSegment {
  SegmentKey key;
  SegmentState state = SegmentState::kStored;
  bool has_data = false;
  std::int64_t start_ns = 0;  // clock of the session
  std::int64_t end_ns = 0;
  // Of at most kMaxPathPoints keyframes, the first and the last among them.
  // Empty for a segment from before paths were kept, and for a damaged one.
  std::vector<PathPoint> path;
  struct Score {
    std::string group;
    double entropy = 0;  // [nat]; NaN where it is not a number
    double gain = 0;
  };
  std::vector<Score> scores;        // by the name of the group
  std::vector<std::string> tables;  // groups that hold it
};

inline constexpr int kMaxPathPoints = 16;

// As they lie in the database, from 1: only ever extended.
enum class AbsenceCause {
  kSaysTooLittle = 1,  // with a joint selection, beyond what is kept
  kOthersSayMore,      // all that were in the full table
  kPushedOut,          // by one that came later
  kTooOld,
  kDeviceChanged,
  kDataEvicted,  // by a quota
  kUnusable,
  kDoesNotFit,    // its residuals, against those of the rig's other segments
  kManyOutliers,  // too many of its observations were left out
};

// Why the table of a group does not hold a scored segment.
struct TableAbsence {
  std::string group;
  AbsenceCause cause = AbsenceCause::kSaysTooLittle;
  std::int64_t time_ns = 0;
  // kOthersSayMore: the worst in the table at that time; kPushedOut: what came
  // instead. The key is missing once nothing is kept of that segment.
  std::optional<SegmentKey> rival;
  std::optional<double> rival_entropy;  // [nat]
  // kDoesNotFit: ResidualStatistics::fit, and the largest that fits.
  std::optional<double> fit;
  std::optional<double> fit_limit;
};

}  // namespace selfcal::server
