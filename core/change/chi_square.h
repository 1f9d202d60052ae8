// The chi-square distribution. Pure, any thread.
#pragma once

namespace selfcal {

// Probability that a chi-square variable with `degrees` > 0 degrees of freedom
// is larger than `statistic` >= 0, to about 1e-12 of itself; 0 where it is
// smaller than the smallest double. Closed form for whole degrees (Abramowitz
// and Stegun, 26.4.4 and 26.4.5).
double ChiSquareTail(double statistic, int degrees);

}  // namespace selfcal
