#include "core/calibration/robust_loss.h"

#include <algorithm>
#include <cmath>

#include "core/model/square.h"

namespace selfcal {
namespace {

// Fraction of the gate at which the weight begins to decrease.
constexpr double kTaperBegin = 0.6;

double PlainWeight(LossKind kind, double scale, double s) {
  switch (kind) {
    case LossKind::kHuber:
      return s <= Square(scale) ? 1.0 : scale / std::sqrt(s);
    case LossKind::kCauchy:
      return 1.0 / (1.0 + s / Square(scale));
    case LossKind::kNone:
      break;
  }
  return 1.0;
}

// s times the derivative of PlainWeight with respect to s.
double PlainSlope(LossKind kind, double scale, double s) {
  switch (kind) {
    case LossKind::kHuber:
      return s <= Square(scale) ? 0.0 : -scale / (2 * std::sqrt(s));
    case LossKind::kCauchy:
      return -s * Square(scale) / Square(s + Square(scale));
    case LossKind::kNone:
      break;
  }
  return 0;
}

double PlainValue(LossKind kind, double scale, double s) {
  switch (kind) {
    case LossKind::kHuber:
      return s <= Square(scale) ? s : 2 * scale * std::sqrt(s) - Square(scale);
    case LossKind::kCauchy:
      return Square(scale) * std::log1p(s / Square(scale));
    case LossKind::kNone:
      break;
  }
  return s;
}

// An antiderivative of PlainWeight(s) (end - s); for Huber, valid if s exceeds
// scale^2.
double TaperedIntegral(LossKind kind, double scale, double end, double s) {
  const double b = Square(scale);
  switch (kind) {
    case LossKind::kHuber:
      return 2 * scale * std::sqrt(s) * (end - s / 3);
    case LossKind::kCauchy:
      return b * ((end + b) * std::log(b + s) - s);
    case LossKind::kNone:
      break;
  }
  return s * (end - s / 2);
}

}  // namespace

double RobustLoss::Weight(double s) const {
  const double weight = PlainWeight(kind, scale, s);
  const double begin = Square(kTaperBegin * gate);
  if (s <= begin) {
    return weight;
  }
  const double end = Square(gate);
  return weight * std::max(0.0, (end - s) / (end - begin));
}

double RobustLoss::Curvature(double s) const {
  const double weight = PlainWeight(kind, scale, s);
  const double plain = weight + PlainSlope(kind, scale, s);
  const double begin = Square(kTaperBegin * gate);
  if (s <= begin) {
    return plain;
  }
  const double end = Square(gate);
  return s < end ? (plain * (end - s) - weight * s) / (end - begin) : 0.0;
}

double RobustLoss::Value(double s) const {
  const double begin = Square(kTaperBegin * gate);
  if (s <= begin) {
    return PlainValue(kind, scale, s);
  }
  const double end = Square(gate);
  const double tapered = TaperedIntegral(kind, scale, end, std::min(s, end)) -
                         TaperedIntegral(kind, scale, end, begin);
  return PlainValue(kind, scale, begin) + tapered / (end - begin);
}

}  // namespace selfcal
