// The causes of exclusions (session.h).
#pragma once

namespace selfcal::server {

// The numbers, from 1, are stored in the database: only ever extended. Lists
// over all rigs find segments by the causes from kTooOld on, which are rare.
enum class ExclusionCause {
  kInsufficientGain = 1,  // joint: beyond what the kept segments have
  kOutranked,             // by all entries of the full table
  kReplaced,              // by a later segment
  kTooOld,
  kDeviceChanged,
  kDataEvicted,  // by a quota
  kUnusable,
  kDoesNotFit,    // larger residuals than the rig's other segments
  kManyOutliers,  // too many of its observations are outliers
};

}  // namespace selfcal::server
