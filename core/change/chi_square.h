// The chi-square distribution. Pure, callable from any thread.
#pragma once

namespace selfcal {

// Probability that a chi-square variable with `degrees` > 0 degrees of freedom
// is larger than `statistic` >= 0, with a relative accuracy of about 1e-12; 0
// if it is smaller than the smallest double. Closed form for integer degrees
// (Abramowitz and Stegun, 26.4.4 and 26.4.5).
double ChiSquareTail(double statistic, int degrees);

}  // namespace selfcal
