// Ages on a device whose wall clock is set while it runs, or while it is off.
#include "server/domain/device_clock.h"

#include <algorithm>
#include <random>

#include "server/domain/device_change.h"
#include "test/promise.h"
#include "test/server/store/store_test.h"

namespace selfcal::server {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

constexpr std::int64_t kMinute_ns = 60'000'000'000;
constexpr std::int64_t kHour_ns = 60 * kMinute_ns;
constexpr std::int64_t kDay_ns = 24 * kHour_ns;
// 2026-11-24T00:00:00Z.
constexpr std::int64_t kToday_ns = 1'795'478'400'000'000'000;

const ClockRecord kLast = {.boot = "first",
                           .since_boot_ns = kHour_ns,
                           .time_ns = kToday_ns,
                           .steady_ns = 5 * kDay_ns};

TEST(AdvanceClock, FollowsTheTimeSinceTheBootWhateverTheWallClockDoes) {
  for (const std::int64_t jump_ns :
       {-kToday_ns, -kDay_ns, -kMinute_ns, kMinute_ns, kDay_ns, kToday_ns}) {
    const ClockAdvance advance =
        AdvanceClock(kLast,
                     {.boot = "first",
                      .since_boot_ns = 3 * kHour_ns,
                      .time_ns = kToday_ns + 2 * kHour_ns + jump_ns});
    EXPECT_EQ(advance.clock.steady_ns, 5 * kDay_ns + 2 * kHour_ns) << jump_ns;
    const bool stepped = std::abs(jump_ns) > kHour_ns;
    EXPECT_EQ(advance.step.has_value(), stepped) << jump_ns;
    EXPECT_EQ(advance.clock.keep_until_ns,
              stepped ? 6 * kDay_ns + 2 * kHour_ns : 0)
        << jump_ns;
  }
}

TEST(AdvanceClock, CountsTheTimeThatTheDeviceWasOff) {
  const ClockAdvance advance = AdvanceClock(kLast,
                                            {.boot = "second",
                                             .since_boot_ns = kMinute_ns,
                                             .time_ns = kToday_ns + kDay_ns});
  EXPECT_EQ(advance.clock.steady_ns, 6 * kDay_ns);
  EXPECT_EQ(advance.clock.boot, "second");
  EXPECT_EQ(advance.step, std::nullopt);
}

TEST(AdvanceClock, DoesNotBelieveAClockThatNoBootExplains) {
  for (const std::int64_t time_ns :
       {std::int64_t{0}, kToday_ns - kDay_ns, kToday_ns + 367 * kDay_ns}) {
    const ClockAdvance advance = AdvanceClock(
        kLast,
        {.boot = "second", .since_boot_ns = kMinute_ns, .time_ns = time_ns});
    EXPECT_EQ(advance.clock.steady_ns, 5 * kDay_ns) << time_ns;
    EXPECT_EQ(advance.clock.keep_until_ns, 6 * kDay_ns) << time_ns;
    ASSERT_TRUE(advance.step.has_value()) << time_ns;
    EXPECT_THAT(*advance.step, HasSubstr("2026-11-24T00:00:00Z"));
    EXPECT_THAT(*advance.step, HasSubstr("booted"));
  }
}

// The name of the boot is the same, but the time since is less than it was.
TEST(AdvanceClock, TakesATimeSinceTheBootThatWentBackForAnotherBoot) {
  const ClockAdvance advance = AdvanceClock(kLast,
                                            {.boot = "first",
                                             .since_boot_ns = kMinute_ns,
                                             .time_ns = kToday_ns + kDay_ns});
  EXPECT_EQ(advance.clock.steady_ns, 6 * kDay_ns);
}

TEST(AdvanceClock, NeverGoesBack) {
  std::mt19937 random(3);
  const auto draw = [&](std::int64_t least, std::int64_t most) {
    return std::uniform_int_distribution<std::int64_t>(least, most)(random);
  };
  ClockRecord clock = kLast;
  ClockReading reading{clock.boot, clock.since_boot_ns, clock.time_ns};
  int steps = 0;
  for (int k = 0; k < 1000; ++k) {
    const std::int64_t dt_ns = draw(0, kDay_ns);
    reading.since_boot_ns += dt_ns;
    reading.time_ns += dt_ns;
    if (draw(0, 9) == 0) reading.time_ns = draw(0, 2 * kToday_ns);
    if (draw(0, 9) == 0) {
      reading.boot = std::to_string(k);
      reading.since_boot_ns = draw(0, kMinute_ns);
    }
    const ClockAdvance advance = AdvanceClock(clock, reading);
    EXPECT_GE(advance.clock.steady_ns, clock.steady_ns);
    EXPECT_GE(advance.clock.keep_until_ns, clock.keep_until_ns);
    steps += advance.step ? 1 : 0;
    clock = advance.clock;
  }
  EXPECT_GT(steps, 50);
}

class DeviceClockTest : public StoreTest {
 protected:
  // Starts the daemon's domain, by the clocks of the device.
  void Start(const Quotas& quotas = {}) {
    Reopen();
    domain_.reset();
    auto opened = DeviceClock::Open(store_.get(), [this] { return reading_; });
    ASSERT_TRUE(opened.ok()) << opened.status();
    clock_ = *std::move(opened);
    domain_.emplace(store_.get(), DomainOptions{.quotas = quotas}, [this] {
      return clock_->Now();
    });
  }
  // Time passes while the device is on; the daemon looks at its clock.
  void Pass(std::int64_t dt_ns) {
    reading_.since_boot_ns += dt_ns;
    reading_.time_ns += dt_ns;
    Observe();
  }
  void SetWallClock(std::int64_t time_ns) {
    reading_.time_ns = time_ns;
    Observe();
  }
  void Observe() {
    const auto step = clock_->Observe();
    ASSERT_TRUE(step.ok()) << step.status();
  }
  void Boot(std::int64_t time_ns) {
    reading_ = {.boot = reading_.boot + "+",
                .since_boot_ns = kMinute_ns,
                .time_ns = time_ns};
  }
  // Creates a rig whose segments leave its tables after this time.
  void CreateRig(std::int64_t max_age_ns) {
    RigPolicy policy;
    policy.table_max_age_ns = max_age_ns;
    rig_.table_size = 100;
    ASSERT_TRUE(domain_->CreateRig(rig_, policy).ok());
  }
  void Arrive(std::int64_t index) {
    Put("a", index);
    Score(rig_, index, 1.0 + static_cast<double>(index));
  }
  std::vector<std::string> Steps() {
    std::vector<std::string> details;
    const auto listed = store_->ListEvents({1000, ""});
    for (const StoredEvent& event : listed->items) {
      if (event.kind == EventKind::kClockStepped) {
        EXPECT_EQ(event.rig, "");
        details.push_back(event.detail);
      }
    }
    return details;
  }

  ClockReading reading_{
      .boot = "boot", .since_boot_ns = kMinute_ns, .time_ns = kToday_ns};
  std::unique_ptr<DeviceClock> clock_;
  Rig rig_ = TestRig("a");
};
SELFCAL_STORE_TEST_SUITE(DeviceClockTest);

// A device without a battery for its clock, at its first contact to a time
// server: its segments are as old as they are.
TEST_P(DeviceClockTest, ASetWallClockEmptiesNoTable) {
  reading_.time_ns = kMinute_ns;  // 1970
  Start();
  CreateRig(7 * kDay_ns);
  Arrive(0);
  Pass(kMinute_ns);
  SetWallClock(kToday_ns);
  Arrive(1);
  EXPECT_THAT(TableIndices("a", 0), ElementsAre(0, 1));
  EXPECT_THAT(Steps(), ElementsAre(HasSubstr("1970-01-01T00:02:00Z to 2026")));
  // The wall clock is what is shown.
  EXPECT_EQ(store_->GetSegment("a", {"s", 1})->receive_time_ns, kToday_ns);
  EXPECT_EQ(store_->GetSegment("a", {"s", 0})->receive_time_ns, kMinute_ns);
  // They leave when they are older than that.
  Pass(6 * kDay_ns);
  Arrive(2);
  EXPECT_THAT(TableIndices("a", 0), ElementsAre(0, 1, 2));
  Pass(kDay_ns + kMinute_ns);
  Arrive(3);
  EXPECT_THAT(TableIndices("a", 0), ElementsAre(2, 3));
  EXPECT_THAT(Steps(), SizeIs(1));
}

TEST_P(DeviceClockTest, AWallClockThatGoesBackHoldsNothingUp) {
  Start();
  CreateRig(7 * kDay_ns);
  Arrive(0);
  SetWallClock(kToday_ns - 100 * kDay_ns);
  Pass(8 * kDay_ns);
  Arrive(1);
  EXPECT_THAT(TableIndices("a", 0), ElementsAre(1));
}

TEST_P(DeviceClockTest, ForADayAfterAStepNothingIsRemovedForItsAge) {
  Start();
  CreateRig(kHour_ns);
  Arrive(0);
  Pass(2 * kHour_ns);
  SetWallClock(kToday_ns + 20 * kDay_ns);
  Arrive(1);
  EXPECT_THAT(TableIndices("a", 0), ElementsAre(0, 1));
  Pass(kDay_ns - kMinute_ns);
  Arrive(2);
  EXPECT_THAT(TableIndices("a", 0), ElementsAre(0, 1, 2));
  Pass(kMinute_ns);
  Arrive(3);
  EXPECT_THAT(TableIndices("a", 0), ElementsAre(2, 3));
}

TEST_P(DeviceClockTest, MetadataIsNotDeletedForAStep) {
  Start({.max_segment_age_s = 7 * 86400});
  CreateRig(0);
  Put("a", 0);
  Score(rig_, 0, 50, 0);  // enters no table
  SetWallClock(kToday_ns + 300 * kDay_ns);
  Put("a", 1);
  EXPECT_TRUE(store_->GetSegment("a", {"s", 0}).ok());
  Pass(8 * kDay_ns);
  Put("a", 2);
  EXPECT_TRUE(absl::IsNotFound(store_->GetSegment("a", {"s", 0}).status()));
}

// The session began before the step.
TEST_P(DeviceClockTest, RigsBecomeIdleByTheTimeThatHasPassed) {
  Start();
  CreateRig(0);
  Arrive(0);
  SetWallClock(kToday_ns + 300 * kDay_ns);
  const auto is_idle = [&] {
    const std::int64_t since_ns = clock_->Now().steady_ns - kMinute_ns;
    EXPECT_THAT(*domain_->StartSessionRuns({}, since_ns), IsEmpty());
    return store_->ListRigsToCheck(RigCheck::kSession, kNoCheck - 1, 10)
        ->empty();
  };
  EXPECT_FALSE(is_idle());
  SetWallClock(kToday_ns);
  Pass(kMinute_ns);
  EXPECT_TRUE(is_idle());
}

TEST_P(DeviceClockTest, ContinuesAfterARestart) {
  Start();
  CreateRig(7 * kDay_ns);
  Arrive(0);
  Pass(2 * kDay_ns);
  Start();
  EXPECT_EQ(clock_->Now().steady_ns, kToday_ns + 2 * kDay_ns);
  Pass(kDay_ns);
  Boot(kToday_ns + 5 * kDay_ns);  // two days off
  Start();
  EXPECT_EQ(clock_->Now().steady_ns, kToday_ns + 5 * kDay_ns);
  EXPECT_THAT(Steps(), IsEmpty());
  Boot(0);  // the battery of the clock was removed
  Start();
  EXPECT_EQ(clock_->Now().steady_ns, kToday_ns + 5 * kDay_ns);
  EXPECT_THAT(Steps(), SizeIs(1));
  SetWallClock(kToday_ns + 6 * kDay_ns);
  EXPECT_THAT(Steps(), SizeIs(2));
  Arrive(1);
  EXPECT_THAT(TableIndices("a", 0), ElementsAre(0, 1));
}

// At random: what is in fact younger than the limit is in the table, and
// nothing is for longer than a day too old.
TEST_P(DeviceClockTest, TablesHoldWhatIsYoungWhateverTheWallClockDoes) {
  constexpr std::int64_t kMaxAge_ns = 7 * kDay_ns;
  Promise promise("a wall clock that is set removes nothing");
  std::mt19937 random(5);
  const auto draw = [&](std::int64_t least, std::int64_t most) {
    return std::uniform_int_distribution<std::int64_t>(least, most)(random);
  };
  Start();
  CreateRig(kMaxAge_ns);
  std::int64_t elapsed_ns = 0;  // in fact
  // When the wall clock was last set, and each segment arrived, by that.
  std::int64_t set_ns = -kDay_ns;
  struct Arrival {
    std::int64_t time_ns;
    int boots;
  };
  std::vector<Arrival> arrivals;
  int boots = 0;  // without a believable clock
  for (; promise.trials < Trials(60); ++promise.trials) {
    const std::int64_t dt_ns = draw(0, kDay_ns);
    elapsed_ns += dt_ns;
    switch (draw(0, 4)) {
      case 0:  // is set, in any direction
        Pass(dt_ns);
        SetWallClock(draw(0, 2 * kToday_ns));
        set_ns = elapsed_ns;
        break;
      case 1:  // the device is off
        Boot(reading_.time_ns + dt_ns);
        Start();
        break;
      case 2:  // its clock forgets the time while it is booted
        Pass(dt_ns);
        Boot(reading_.time_ns - draw(2 * kHour_ns, kToday_ns));
        Start();
        set_ns = elapsed_ns;
        ++boots;
        break;
      default:
        Pass(dt_ns);
    }
    Arrive(std::ssize(arrivals));
    arrivals.push_back({elapsed_ns, boots});
    const std::vector<std::int64_t> held = TableIndices("a", 0);
    for (std::int64_t k = 0; k < std::ssize(arrivals); ++k) {
      const bool is_held = std::find(held.begin(), held.end(), k) != held.end();
      const std::int64_t age_ns = elapsed_ns - arrivals[k].time_ns;
      const std::int64_t lost_ns = (boots - arrivals[k].boots) * kHour_ns;
      const bool must = age_ns <= kMaxAge_ns;
      const bool may = age_ns <= kMaxAge_ns + lost_ns ||
                       elapsed_ns - set_ns < kDay_ns + lost_ns;
      if ((must && !is_held) || (!may && is_held)) ++promise.lost;
    }
  }
}

// The certainty of a calibration decreases with the time that has passed.
TEST_P(DeviceClockTest, CalibrationsDoNotAgeByAStep) {
  Start();
  CreateRig(0);
  const StoredRig rig = *store_->GetRig("a");
  const StoredCalibration factory = *store_->GetActiveCalibration("a");
  const Eigen::MatrixXd after_a_day =
      CovarianceAt(rig, factory, kToday_ns + kDay_ns);
  ASSERT_NE(after_a_day, factory.covariance);
  SetWallClock(kToday_ns + 300 * kDay_ns);
  Pass(kDay_ns);
  EXPECT_EQ(CovarianceAt(rig, factory, clock_->Now().steady_ns), after_a_day);
}

}  // namespace
}  // namespace selfcal::server
