#pragma once

namespace selfcal {

inline constexpr double kGravity = 9.81;  // [m/s^2]

}  // namespace selfcal
