#pragma once

namespace selfcal {

constexpr double Square(double x) { return x * x; }

}  // namespace selfcal
