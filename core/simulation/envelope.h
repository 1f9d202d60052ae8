// Excitation of a motion over time: constant levels joined by quintic steps, so
// that value, first and second derivative are continuous.
#pragma once

#include <vector>

namespace selfcal {

class Envelope {
 public:
  // Value, its derivatives, and its integral from 0.
  struct Sample {
    double value;
    double d1;        // [1/s]
    double d2;        // [1/s^2]
    double integral;  // [s]
  };

  // Begins at time 0 at this level.
  explicit Envelope(double level) : level_(level) {}

  // Holds the level, or moves to another one, for the next duration_s > 0.
  void Hold(double duration_s) { MoveTo(level_, duration_s); }
  void MoveTo(double level, double duration_s);

  // End of the last piece; the level is constant from there on.
  double end_s() const { return end_s_; }
  // t_s >= 0.
  Sample At(double t_s) const;

 private:
  struct Piece {
    double begin_s;
    double duration_s;
    double from;
    double to;
    double integral;  // up to its start
  };
  std::vector<Piece> pieces_;
  double level_;
  double end_s_ = 0;
  double end_integral_ = 0;
};

}  // namespace selfcal
