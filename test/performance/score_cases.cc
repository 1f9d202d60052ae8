// The score of one segment against general solvers on the same factors, and
// against parts of itself.
#include <benchmark/benchmark.h>

#include <string>

#include "core/information/linearisation.h"
#include "core/simd/vector_width.h"
#include "test/performance/cases.h"
#include "test/performance/scene.h"
#include "test/performance/score.h"
#include "test/reference/ceres_segment.h"
#include "test/reference/segment_jacobian.h"
#include "test/reference/sparse_qr.h"

namespace selfcal {
namespace {

constexpr int kGauge = 0;

Measurement AgainstCeresCovariance(VectorWidth width,
                                   const TimingOptions& options) {
  const Scene scene = MakeScene();
  const MotionSegment& segment = scene.segments.front();
  CeresSegment ceres(
      scene.rig, scene.rig.factory, segment, Select(scene, segment), kGauge);
  return CompareTimes({"ceres::Covariance",
                       [&] { benchmark::DoNotOptimize(ceres.Posterior()); }},
                      ScoreOf(scene, width),
                      options);
}

Measurement AgainstSparseQr(const TimingOptions& options) {
  const Scene scene = MakeScene();
  const MotionSegment& segment = scene.segments.front();
  SparseQr qr(BuildSegmentJacobian(scene.rig,
                                   scene.rig.factory,
                                   segment,
                                   Select(scene, segment),
                                   PriorSigmas(scene.rig),
                                   kGauge));
  return CompareTimes({"SuiteSparseQR", [&] { qr.Factorise(); }},
                      ScoreOf(scene, WidestVectors()),
                      options);
}

Measurement AgainstCeresEvaluate(const TimingOptions& options) {
  const Scene scene = MakeScene();
  const MotionSegment& segment = scene.segments.front();
  CeresSegment ceres(
      scene.rig, scene.rig.factory, segment, Select(scene, segment), kGauge);
  return CompareTimes({"ceres::Problem::Evaluate",
                       [&] { benchmark::DoNotOptimize(ceres.Evaluate()); }},
                      ScoreOf(scene, WidestVectors()),
                      options);
}

Measurement AgainstLinearisation(const TimingOptions& options) {
  const Scene scene = MakeScene();
  const MotionSegment& segment = scene.segments.front();
  const InlierSelection selection = Select(scene, segment);
  ObservationOrder order;
  order.Find(segment, static_cast<int>(scene.rig.factory.cameras.size()));
  SegmentLineariser lineariser;
  return CompareTimes(
      ScoreOf(scene, WidestVectors()),
      {"linearisation",
       [&] {
         lineariser.LineariseAlone(
             scene.rig, scene.rig.factory, segment, {}, selection, order);
       }},
      options);
}

}  // namespace

std::vector<Case> ScoreCases() {
  std::vector<Case> cases;
  if (HasVectors(VectorWidth::k4)) {
    cases.push_back({.name = "score: AVX2 against ceres::Covariance",
                     .must = 60,
                     .goal = 100,
                     .measure = [](const TimingOptions& options) {
                       return AgainstCeresCovariance(VectorWidth::k4, options);
                     }});
  }
  cases.push_back({.name = "score: portable against ceres::Covariance",
                   .must = 25,
                   .goal = 40,
                   .measure = [](const TimingOptions& options) {
                     return AgainstCeresCovariance(VectorWidth::k2, options);
                   }});
  cases.push_back({.name = "score against sparse QR, theta last",
                   .must = 40,
                   .goal = 70,
                   .measure = AgainstSparseQr});
  cases.push_back({.name = "score against one ceres::Problem::Evaluate",
                   .must = 3,
                   .goal = 5,
                   .measure = AgainstCeresEvaluate});
  cases.push_back({.name = "score against its own linearisation",
                   .must = 8,
                   .goal = 6,
                   .higher_is_better = false,
                   .measure = AgainstLinearisation});
  return cases;
}

}  // namespace selfcal
