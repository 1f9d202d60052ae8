// A rig that estimates every block: no block changes unnoticed, none gives a
// false alarm, and its group is the one that is concerned.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <iterator>
#include <set>
#include <string>
#include <vector>

#include "core/change/detect_change.h"
#include "core/change/theta_parts.h"
#include "core/model/parameter_blocks.h"
#include "test/core/change/random_information.h"
#include "test/core/simulation/rigs.h"

namespace selfcal {
namespace {

using ::testing::Contains;
using ::testing::IsEmpty;

// One axis of each accelerometer defines the origin of its body. The prior of
// each component is ten reference sigmas, the default of most: about some
// slopes a rig knows more than a segment tells unless it states otherwise, and
// what no segment tells cannot be tested.
Rig RigOfAllBlocks() {
  Rig rig = HandheldRig("all");
  EstimateEveryBlock(&rig);
  rig.fixed = {"imu.accel.position.x.*", "imu1.accel.position.x.*"};
  for (const TangentComponent& one : TangentComponents(rig.factory)) {
    rig.prior_sigmas.push_back({one.name, 10 * one.sigma_ref});
  }
  return rig;
}

// Names of the blocks with a free component.
std::set<std::string> EstimatedBlocks(const Rig& rig) {
  const std::vector<std::string> blocks = ComponentBlocks(rig.factory);
  std::set<std::string> estimated;
  for (const int i : FreeComponents(rig)) estimated.insert(blocks[i]);
  return estimated;
}

// The component itself, or one of the components of the block.
bool IsOfBlock(const std::string& component, const std::string& block) {
  return component == block || component.starts_with(block + ".");
}

class AllBlocks : public ::testing::Test {
 protected:
  // Those that a hand-held device with one IMU does not estimate.
  std::vector<std::string> OptionalBlocks() const {
    const std::set<std::string> all = EstimatedBlocks(rig_);
    const std::set<std::string> plain = EstimatedBlocks(HandheldRig("plain"));
    std::vector<std::string> optional;
    std::set_difference(all.begin(),
                        all.end(),
                        plain.begin(),
                        plain.end(),
                        std::back_inserter(optional));
    return optional;
  }

  // Each free component of the block by this many reference sigmas.
  Eigen::VectorXd Step(const std::string& block, double sigmas) const {
    const std::vector<std::string> blocks = ComponentBlocks(rig_.factory);
    Eigen::VectorXd offset = zero_;
    for (const int i : FreeComponents(rig_)) {
      if (blocks[i] == block) offset(i) = sigmas * ReferenceSigmas(rig_)(i);
    }
    return offset;
  }

  std::vector<std::string> GroupsWith(const std::string& block) const {
    const std::vector<std::string> blocks = ComponentBlocks(rig_.factory);
    std::vector<std::string> names;
    for (const ParameterGroup& group : rig_.groups) {
      const std::vector<int> at = GroupComponents(rig_, group);
      if (std::any_of(at.begin(), at.end(), [&](int i) {
            return blocks[i] == block;
          })) {
        names.push_back(group.name);
      }
    }
    return names;
  }

  // Appends the next segments of a device with the given offset.
  void Many(int count, const Eigen::VectorXd& offset) {
    for (int i = 0; i < count; ++i) {
      newest_.push_back(
          tester_.Offset(random_.Segment(rig_, rig_.factory, offset)));
    }
  }

  const Rig rig_ = RigOfAllBlocks();
  const Eigen::VectorXd zero_ =
      Eigen::VectorXd::Zero(TangentSize(rig_.factory));
  RandomInformation random_{11};
  const KnownCalibration active_ = FactoryKnownTo(rig_, 0.05);
  const ConsistencyTester tester_{rig_, active_};
  std::vector<OffsetInformation> newest_;
};

TEST_F(AllBlocks, AreEstimatedByAValidRig) {
  EXPECT_THAT(Validate(rig_), IsEmpty());
  constexpr std::size_t kOfImu = std::size(kImuBlocks) + std::size(kImuSlopes);
  EXPECT_EQ(EstimatedBlocks(rig_).size(),
            2 * kOfImu + std::size(kMountBlocks) + std::size(kCameraBlocks) +
                std::size(kCameraSlopes));
}

TEST_F(AllBlocks, HaveEachComponentInOneGroupAndInThePartOfItsBlock) {
  const std::vector<int> free = FreeComponents(rig_);
  const std::vector<TangentComponent> components =
      TangentComponents(rig_.factory);
  std::vector<int> of_all(free.size()), of_groups(free.size()),
      of_blocks(free.size());
  const auto counts = [&](const std::string& part) -> std::vector<int>& {
    if (part == "all") return of_all;
    return part.find('.') == std::string::npos ? of_groups : of_blocks;
  };
  double shares = 0;
  for (const ThetaPart& part : ThetaParts(rig_)) {
    EXPECT_GT(part.share, 0) << part.name;
    shares += part.share;
    if (part.name.ends_with(".zoom")) continue;
    std::vector<int>& counted = counts(part.name);
    for (const int k : part.at) {
      ++counted[k];
      if (&counted != &of_blocks) continue;
      EXPECT_TRUE(IsOfBlock(components[free[k]].name, part.name))
          << components[free[k]].name << " in " << part.name;
    }
  }
  for (std::size_t k = 0; k < free.size(); ++k) {
    const std::string& name = components[free[k]].name;
    EXPECT_EQ(of_all[k], 1) << name;
    EXPECT_EQ(of_groups[k], 1) << name;
    EXPECT_EQ(of_blocks[k], 1) << name;
  }
  EXPECT_NEAR(shares, 1, 1e-12);  // rounding
}

// Eight reference sigmas are far beyond what four segments can overlook, and
// few enough that they leak little into the parts of other blocks.
TEST_F(AllBlocks, AStepOfAnOptionalBlockIsDetectedInItsGroup) {
  const std::vector<std::string> optional = OptionalBlocks();
  EXPECT_THAT(optional, Contains("imu1.time_offset"));
  for (const std::string& block : optional) {
    SCOPED_TRACE(block);
    newest_.clear();
    Many(4, zero_);
    Many(4, Step(block, 8));
    const auto change = DetectChange(tester_, newest_);
    const std::vector<std::string> groups = GroupsWith(block);
    EXPECT_TRUE(change);
    EXPECT_EQ(groups.size(), 1u);
    if (!change || groups.empty()) continue;
    EXPECT_THAT(change->concerned, Contains(groups[0]));
    // All of them would mean that no group was found.
    EXPECT_LT(change->concerned.size(), rig_.groups.size());
  }
}

// The number of segments is that of each device of DetectChangeTest.
TEST_F(AllBlocks, WithoutAStepNothingIsDetected) {
  const Eigen::VectorXd error = random_.Noise(active_.covariance);
  for (int i = 0; i < 40; ++i) {
    Many(1, error);
    EXPECT_FALSE(DetectChange(tester_, newest_)) << i;
  }
}

}  // namespace
}  // namespace selfcal
