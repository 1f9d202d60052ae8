#include "core/simulation/envelope.h"

#include <algorithm>
#include <iterator>

namespace selfcal {

void Envelope::MoveTo(double level, double duration_s) {
  pieces_.push_back({end_s_, duration_s, level_, level, end_integral_});
  end_s_ += duration_s;
  // The step is antisymmetric about its middle: its mean is that of its ends.
  end_integral_ += 0.5 * (level_ + level) * duration_s;
  level_ = level;
}

Envelope::Sample Envelope::At(double t_s) const {
  if (t_s >= end_s_) {
    return {level_, 0, 0, end_integral_ + level_ * (t_s - end_s_)};
  }
  const auto next = std::upper_bound(
      pieces_.begin(), pieces_.end(), t_s, [](double t, const Piece& piece) {
        return t < piece.begin_s;
      });
  const Piece& piece = *std::prev(next);
  const double T = piece.duration_s;
  const double u = (t_s - piece.begin_s) / T;
  const double step = piece.to - piece.from;
  const double s = u * u * u * (10 + u * (-15 + u * 6));
  const double d1 = 30 * u * u * (1 - u) * (1 - u);
  const double d2 = 60 * u * (1 + u * (-3 + u * 2));
  const double integral = u * u * u * u * (2.5 + u * (-3 + u));
  return {piece.from + step * s,
          step * d1 / T,
          step * d2 / (T * T),
          piece.integral + T * (piece.from * u + step * integral)};
}

}  // namespace selfcal
