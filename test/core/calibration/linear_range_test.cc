#include "core/calibration/linear_range.h"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <random>
#include <vector>

#include "core/calibration/theta_information.h"
#include "core/simulation/simulate.h"
#include "test/core/information/simple_motions.h"

namespace selfcal {
namespace {

// A simulated motion, linearised at its truth.
class Simulated {
 public:
  Simulated(MotionKind kind, int seed)
      : rig_(HandheldRig("simulated")), nothing_(TangentSize(rig_.factory), 0) {
    std::mt19937 random(seed);
    SimulationOptions options;
    options.seed = seed;
    options.keyframes_per_segment = 20;
    options.landmarks_in_view = 60;
    session_ = Simulate(rig_,
                        rig_.factory,
                        rig_.factory,
                        *RandomMotion(kind, 4.5, &random),
                        "session",
                        options);
    for (std::size_t i = 0; i < session_.segments.size(); ++i) {
      session_.segments[i].keyframes = session_.truth[i].keyframes;
    }
    sorted_ = SortByKey(session_.segments);
    problem_ = FlattenSegments(rig_, sorted_, PartitionSegments(sorted_, 15));
    estimate_ = {Eigen::VectorXd::Zero(nothing_.rows()), problem_.keyframes};
    MeasureMotions(rig_, rig_.factory, problem_, problem_.keyframes, &motions_);
    screening_ = ScreenLandmarks(rig_,
                                 rig_.factory,
                                 problem_,
                                 problem_.keyframes,
                                 motions_,
                                 {},
                                 nullptr);
    whitening_ = WhitenInertialLinks(
        rig_, rig_.factory.imu, problem_, problem_.keyframes);
  }

  const Rig& rig() const { return rig_; }

  LinearRange Range() const {
    return LinearRange({.rig = rig_,
                        .reference = rig_.factory,
                        .problem = problem_,
                        .motions = motions_,
                        .whitening = whitening_,
                        .basis = nothing_,
                        .loss = screening_.loss},
                       estimate_,
                       screening_.landmarks);
  }

 private:
  Rig rig_;
  Eigen::MatrixXd nothing_;
  SimulatedSession session_;
  std::vector<const MotionSegment*> sorted_;
  CalibrationProblem problem_;
  CalibrationEstimate estimate_;
  KeyframeMotions motions_;
  Screening screening_;
  std::vector<InertialMatrix> whitening_;
};

TEST(LinearRange, TheCostOfHandHeldMotionGrowsAsClaimed) {
  const Simulated simulated(MotionKind::kHandheld, 1);
  const LinearRange range = simulated.Range();
  ASSERT_TRUE(range.settled());
  const ThetaSubspace observed =
      ObservedSubspace(simulated.rig(), range.information().Lambda, 0);
  EXPECT_EQ(observed.held.cols(), 0);
  const Eigen::MatrixXd basis = TangentBasis(simulated.rig(), observed);
  for (int j = 0; j < basis.cols(); ++j) {
    EXPECT_TRUE(range.Holds(basis.col(j))) << "direction " << j;
    // The length of the step does not matter.
    EXPECT_TRUE(range.Holds(-1e-3 * basis.col(j))) << "direction " << j;
  }
}

// The data of a rotation about one axis seems to tell something of directions
// along which the cost does not grow as that has it.
TEST(LinearRange, WeakDirectionsOfOneAxisDoNotKeepTheirPromise) {
  int settled = 0;
  int weak = 0;
  int refused = 0;
  for (int seed = 1; seed <= 6; ++seed) {
    const Simulated simulated(MotionKind::kOneAxis, seed);
    const LinearRange range = simulated.Range();
    if (!range.settled()) continue;
    ++settled;
    const Eigen::MatrixXd& Lambda = range.information().Lambda;
    const ThetaSubspace observed = ObservedSubspace(simulated.rig(), Lambda, 0);
    const ThetaSubspace kept = TrustedSubspace(simulated.rig(), range, 100);
    weak += static_cast<int>(
        ObservedSubspace(simulated.rig(), Lambda, 0, 100).held.cols() -
        observed.held.cols());
    refused += static_cast<int>(kept.held.cols() - observed.held.cols());
    EXPECT_GE(kept.held.cols(), observed.held.cols());
    EXPECT_EQ(kept.held.cols() + kept.estimated.cols(),
              static_cast<int>(FreeComponents(simulated.rig()).size()));
  }
  EXPECT_GE(settled, 3);
  EXPECT_GT(refused, 0);
  EXPECT_LE(refused, weak);
}

TEST(LinearRange, WithoutWeakOnesNothingMoreIsHeld) {
  const Simulated simulated(MotionKind::kOneAxis, 1);
  const LinearRange range = simulated.Range();
  ASSERT_TRUE(range.settled());
  EXPECT_EQ(TrustedSubspace(simulated.rig(), range, 1).held.cols(),
            ObservedSubspace(simulated.rig(), range.information().Lambda, 0)
                .held.cols());
}

TEST(LinearRange, ADirectionWithoutInformationDoesNotHold) {
  const Simulated simulated(MotionKind::kHandheld, 1);
  const LinearRange range = simulated.Range();
  EXPECT_FALSE(
      range.Holds(Eigen::VectorXd::Zero(TangentSize(simulated.rig().factory))));
}

}  // namespace
}  // namespace selfcal
