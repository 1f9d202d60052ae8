// Whether a segment fits well enough to be kept: motion that says much is worth
// nothing where residuals show that states, readings or landmarks are wrong.
//
// A segment is compared with others of its rig, not with the noise that the
// rig states: where that is wrong, it is so for all of them alike. Pure
// functions.
#pragma once

#include <optional>
#include <vector>

namespace selfcal {

struct FitPolicy {
  // Largest fit over the median: 1 plus so many standard deviations of the fits
  // over their median (a robust one, from their median distance to it), within
  // the bounds below.
  double max_deviations = 10;
  // Residuals of sound segments differ with how fast the device moves and how
  // the tracker copes: by up to a fifth from the median in the recordings and
  // in simulated scenes of which a tenth moves. Stamps that are off by 10 ms
  // and exchanged cameras double them.
  double least_ratio = 1.5;
  // Information is divided by the square of the fit: three times the residuals
  // of the others are a ninth of what the motion claims, so that little is lost
  // where such a segment was sound after all.
  double max_ratio = 3;
  // The newest segments of a rig, for their median.
  int newest = 16;
  // With fewer there is no median to speak of.
  int min_compared = 4;
};

// The largest ResidualStatistics::fit of a segment that fits. `newest` are the
// fits of the newest scored segments, `kept` of those in the tables; those that
// were not measured (0) do not count.
//
// It is the smaller one that follows from both kinds: where the first segments
// of a rig are bad they fill the tables, and leave them once the newest are
// mostly good; a bad session between good ones may outnumber these among the
// newest, and still does not fit to what is kept. What lies within
// the stated noise (a fit of 1) always fits. Nothing: too few to compare with.
std::optional<double> LargestFit(const std::vector<double>& newest,
                                 const std::vector<double>& kept,
                                 const FitPolicy& policy = {});

}  // namespace selfcal
