#include "core/calibration/segment_agreement.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>

#include "core/calibration/segment_part.h"
#include "core/change/chi_square.h"
#include "core/model/median.h"

namespace selfcal {
namespace {

// False-alarm probability, over all segments of a calibration.
constexpr double kFalseAlarm = 1e-5;
// Residuals larger than those of the other segments by this factor are not
// comparable.
constexpr double kMaxRatio = 3;

std::string Percent(const char* what, double ratio, double usual) {
  char text[160];
  std::snprintf(text,
                sizeof text,
                "its %s residuals are %.1f times what is expected, those of "
                "the other segments %.1f times",
                what,
                ratio,
                usual);
  return text;
}

// The states that an inertial residual connects absorb most of it, and how much
// differs from rig to rig: each is compared with the others.
void RelateInertial(std::vector<SegmentEvidence>* evidence) {
  std::vector<double> values;
  for (const SegmentEvidence& one : *evidence) {
    values.push_back(one.fit.inertial_ratio);
  }
  const double usual = UpperMedian(std::move(values));
  for (SegmentEvidence& one : *evidence) {
    one.fit.inertial_ratio = usual > 0 ? one.fit.inertial_ratio / usual : 0;
  }
}

}  // namespace

std::vector<SegmentEvidence> CollectEvidence(
    const WorkingPoint& point,
    const std::vector<const MotionSegment*>& segments,
    double squares_of_a_reprojection) {
  const Rig& rig = point.rig();
  const double pixel_sigma_px = rig.pixel_sigma_px * point.track_noise_factor();
  const Eigen::MatrixXd basis = TangentBasis(rig, point.subspace());
  std::vector<SegmentEvidence> evidence;
  KeyframeRange range;
  for (const MotionSegment* segment : segments) {
    range.first += range.count;
    range.count = static_cast<int>(segment->keyframes.size());
    const SegmentPart part = LineariseSegmentPart(point, range);
    SegmentEvidence& one = evidence.emplace_back();
    one.fit.key = segment->key;
    one.Lambda = basis.transpose() * part.theta.Lambda * basis;
    one.eta = basis.transpose() * part.theta.eta;
    if (squares_of_a_reprojection > 0) {
      one.fit.pixel_ratio = part.reprojection_rms_px / pixel_sigma_px /
                            std::sqrt(squares_of_a_reprojection);
    }
    one.fit.inertial_ratio = part.inertial_rms;
  }
  RelateInertial(&evidence);
  return evidence;
}

namespace {

struct Sum {
  Eigen::MatrixXd Lambda;
  Eigen::VectorXd eta;

  void Add(const SegmentEvidence& one, double sign = 1) {
    if (Lambda.size() == 0) {
      Lambda = Eigen::MatrixXd::Zero(one.eta.size(), one.eta.size());
      eta = Eigen::VectorXd::Zero(one.eta.size());
    }
    Lambda += sign * one.Lambda;
    eta += sign * one.eta;
  }
};

AgreementTest TestOne(const SegmentEvidence& one, const Sum& all) {
  Sum rest = all;
  rest.Add(one, -1);
  return TestAgreement(one.Lambda, one.eta, rest.Lambda, rest.eta, 1);
}

double PerDegree(const AgreementTest& test) {
  return test.degrees > 0 ? test.statistic / test.degrees : 0;
}

}  // namespace

double TestEach(std::vector<SegmentEvidence>* evidence) {
  Sum all;
  for (const SegmentEvidence& one : *evidence) all.Add(one);
  double squares = 0;
  int degrees = 0;
  for (SegmentEvidence& one : *evidence) {
    one.fit.others = TestOne(one, all);
    squares += one.fit.others.statistic;
    degrees += one.fit.others.degrees;
  }
  if (degrees == 0) return 1;
  const double excess = squares / degrees;
  // The probability of a larger excess by chance is one in a thousand.
  return excess > 1 + 3.1 * std::sqrt(2.0 / degrees) ? excess : 1;
}

AgreementTest TestHalves(const std::vector<SegmentEvidence>& evidence,
                         double excess) {
  if (evidence.size() < kLeastToAgree) return {};
  Sum first, second;
  for (std::size_t i = 0; i < evidence.size(); ++i) {
    (i < evidence.size() / 2 ? first : second).Add(evidence[i]);
  }
  return TestAgreement(
      first.Lambda, first.eta, second.Lambda, second.eta, excess);
}

std::vector<Contradiction> FindContradictions(
    const std::vector<SegmentEvidence>& evidence, bool converged) {
  std::vector<Contradiction> found;
  const auto size = static_cast<int>(evidence.size());
  if (size < kLeastToAgree) return found;
  std::vector<int> left(evidence.size());
  for (int i = 0; i < size; ++i) left[i] = i;
  const auto usual = [&](double SegmentFit::*ratio) {
    std::vector<double> values;
    for (const int i : left) values.push_back(evidence[i].fit.*ratio);
    return UpperMedian(std::move(values));
  };
  const double pixels = usual(&SegmentFit::pixel_ratio);
  const double inertial = usual(&SegmentFit::inertial_ratio);
  const auto leave_out = [&](int at, std::string reason) {
    found.push_back({left[at], std::move(reason)});
    left.erase(left.begin() + at);
  };
  for (int at = size - 1; converged && at >= 0; --at) {
    const SegmentFit& fit = evidence[left[at]].fit;
    if (fit.inertial_ratio > kMaxRatio * std::max(1.0, inertial)) {
      leave_out(at, Percent("inertial", fit.inertial_ratio, inertial));
    } else if (fit.pixel_ratio > kMaxRatio * std::max(1.0, pixels)) {
      leave_out(at, Percent("reprojection", fit.pixel_ratio, pixels));
    }
  }
  while (static_cast<int>(left.size()) >= kLeastToAgree &&
         2 * static_cast<int>(left.size() - 1) > size) {
    Sum all;
    for (const int i : left) all.Add(evidence[i]);
    std::vector<AgreementTest> tests;
    std::vector<double> per_degree;
    for (const int i : left) {
      tests.push_back(TestOne(evidence[i], all));
      per_degree.push_back(PerDegree(tests.back()));
    }
    const double scale = std::max(1.0, UpperMedian(per_degree));
    const auto worst = static_cast<int>(
        std::max_element(per_degree.begin(), per_degree.end()) -
        per_degree.begin());
    const AgreementTest& test = tests[worst];
    if (test.degrees == 0 ||
        ChiSquareTail(test.statistic / scale, test.degrees) >=
            kFalseAlarm / size) {
      break;
    }
    char text[160];
    std::snprintf(text,
                  sizeof text,
                  "its calibration contradicts that of the other segments: "
                  "chi-square %.0f with %d degrees, usual is %.1f a degree",
                  test.statistic,
                  test.degrees,
                  scale);
    leave_out(worst, text);
  }
  return found;
}

std::vector<Contradiction> FindMisfits(const std::vector<double>& fits) {
  std::vector<Contradiction> found;
  std::vector<double> measured;
  std::copy_if(
      fits.begin(), fits.end(), std::back_inserter(measured), [](double fit) {
        return fit > 0;
      });
  if (measured.size() < kLeastToAgree) return found;
  const double usual = std::max(1.0, UpperMedian(measured));
  for (std::size_t i = 0; i < fits.size(); ++i) {
    if (fits[i] > kMaxRatio * usual) {
      found.push_back({static_cast<int>(i), Percent("own", fits[i], usual)});
    }
  }
  return found;
}

}  // namespace selfcal
