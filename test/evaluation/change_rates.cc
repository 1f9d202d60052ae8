// False alarms of the sequential test, on as many segments as a small rate
// takes: normal ones, with the information of simulated segments.
#include <Eigen/Cholesky>
#include <algorithm>
#include <vector>

#include "core/change/detect_change.h"
#include "core/simulation/random.h"
#include "test/evaluation/change_device.h"
#include "test/evaluation/statistics.h"

namespace selfcal {
namespace {

struct Rate {
  double stated = 0;
  int segments = 0;
  int alarms = 0;
};

Rate MeasureRate(double stated,
                 int segments,
                 const ChangeDevice& device,
                 const std::vector<SegmentInformation>& pool,
                 std::uint64_t seed) {
  constexpr int kLife = 200;  // segments with one active calibration
  const ConsistencyTester tester(device.rig, device.active);
  std::vector<OffsetInformation> offsets;
  std::vector<Eigen::MatrixXd> roots;
  for (const SegmentInformation& information : pool) {
    if (!tester.Accepts(information)) continue;
    offsets.push_back(tester.Offset(information));
    roots.push_back(offsets.back().Lambda.llt().matrixL());
  }
  const std::vector<int> free = FreeComponents(device.rig);
  const Eigen::VectorXd scale = PriorSigmas(device.rig)(free).cwiseInverse();
  const Eigen::MatrixXd root_active =
      (scale.asDiagonal() * device.active.covariance(free, free) *
       scale.asDiagonal())
          .llt()
          .matrixL();
  Random random(seed, 1);
  const auto normal = [&](Eigen::Index size) {
    Eigen::VectorXd values(size);
    for (double& value : values) value = random.Normal();
    return values;
  };
  ChangeOptions options;
  options.false_alarm_rate = stated;
  Rate rate{stated, segments, 0};
  Eigen::VectorXd error;
  std::vector<OffsetInformation> newest;
  for (int i = 0; i < segments; ++i) {
    if (i % kLife == 0) {
      error = root_active * normal(scale.size());
      newest.clear();
    }
    const std::size_t which = random.Index(offsets.size());
    OffsetInformation segment = offsets[which];
    segment.eta = segment.Lambda * error + roots[which] * normal(scale.size());
    newest.push_back(segment);
    if (static_cast<int>(newest.size()) > options.max_window) {
      newest.erase(newest.begin());
    }
    if (DetectChange(tester, newest, options)) {
      ++rate.alarms;
      newest.clear();
    }
  }
  return rate;
}

}  // namespace

void RunChangeRates(const ChangeDevice& device,
                    const std::vector<SegmentInformation>& pool,
                    Context* context) {
  const int scale = context->quick() ? 1 : 10;
  std::vector<Rate> rates = {
      {0.1, 300 * scale}, {0.01, 600 * scale}, {0.001, 2000 * scale}};
  context->ForEach(static_cast<int>(rates.size()), [&](int i) {
    rates[i] =
        MeasureRate(rates[i].stated, rates[i].segments, device, pool, 10 + i);
  });
  ResultTable table({"stated rate",
                     "segments",
                     "false alarms",
                     "alarms / segment",
                     "at most, with 99.9 %",
                     "mean run length to a false alarm, at least"});
  double worst = 0;
  for (const Rate& rate : rates) {
    const double at_most =
        BinomialUpperBound(rate.alarms, rate.segments, 0.999);
    worst = std::max(worst, at_most / rate.stated);
    table.Add({rate.stated,
               static_cast<long>(rate.segments),
               static_cast<long>(rate.alarms),
               static_cast<double>(rate.alarms) / rate.segments,
               at_most,
               1 / at_most});
  }
  context->WriteTable("false_alarms", table);
  context->AtMost("change.sequential_rate_upper_bound_by_stated", worst, 1);
  context->Progress("rates of false alarms");
}

}  // namespace selfcal
