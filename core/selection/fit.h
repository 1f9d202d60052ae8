// Decides whether a segment fits well enough to be kept: an informative motion
// is worthless if residuals show that states, readings or landmarks are wrong.
//
// A segment is compared with others of its rig, not with the noise that the rig
// states: if that is wrong, it is wrong for all of them alike. Pure functions.
#pragma once

#include <optional>
#include <vector>

namespace selfcal {

struct FitPolicy {
  // Largest fit relative to the median: 1 plus this many standard deviations of
  // the fits over their median (robust, estimated from their median distance to
  // it), within the bounds below.
  double max_deviations = 10;
  // Residuals of good segments vary with the speed of the device and the
  // quality of tracking: by up to a fifth from the median in the recordings and
  // in simulated scenes of which a tenth moves. Timestamps with an error of 10
  // ms and exchanged cameras double them.
  double least_ratio = 1.5;
  // Information is divided by the square of the fit: with three times the
  // residuals of the others, a segment has a ninth of the claimed information,
  // so that little is lost if it was good after all.
  double max_ratio = 3;
  // Number of newest segments of a rig that determine the median.
  int newest = 16;
  // Least number of segments for which the median is used.
  int min_compared = 4;
};

// Returns the largest ResidualStatistics::fit of a segment that fits. `newest`
// are the fits of the newest scored segments, `kept` of those in the tables;
// those that were not measured (0) are ignored.
//
// It is the smaller one of the limits from both kinds: if the first segments of
// a rig are bad they fill the tables, and leave them once the newest are mostly
// good; a bad session between good ones may outnumber these among the newest,
// but still does not fit those in the tables. A fit within the stated noise (1)
// is always accepted. Returns nullopt if there are too few to compare with.
std::optional<double> LargestFit(const std::vector<double>& newest,
                                 const std::vector<double>& kept,
                                 const FitPolicy& policy = {});

}  // namespace selfcal
