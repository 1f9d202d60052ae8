// False alarms on motions of all kinds, rotation in place among them, in turn:
// their segments claim information that noise in the states of the SLAM system
// makes up. Scored at the active version, and at another that the SLAM system
// worked with.
#include <array>
#include <functional>
#include <memory>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "core/change/detect_change.h"
#include "core/simulation/simulate.h"
#include "test/core/information/simple_motions.h"
#include "test/evaluation/change_device.h"
#include "test/evaluation/statistics.h"

namespace selfcal {
namespace {

constexpr int kRotationFirstDevice = 44000;  // seeds of their own
constexpr int kEach = 10;                    // segments of a kind in a row
constexpr double kReach = 0.9;               // largest, in reference sigmas

// The body turns about a point at a distance from the IMU.
class Pivot final : public Trajectory {
 public:
  Pivot(std::unique_ptr<Trajectory> rotation, const Eigen::Vector3d& lever_m)
      : rotation_(std::move(rotation)), lever_m_(lever_m) {}
  double duration_s() const override { return rotation_->duration_s(); }
  BodyMotion At(double t_s) const override {
    constexpr double kStep_s = 1e-4;
    BodyMotion motion = rotation_->At(t_s);
    motion.p_GI += motion.q_GI * lever_m_;
    motion.v_GI += Velocity(t_s);
    motion.a_GI +=
        (Velocity(t_s + kStep_s) - Velocity(t_s - kStep_s)) / (2 * kStep_s);
    return motion;
  }

 private:
  Eigen::Vector3d Velocity(double t_s) const {
    const BodyMotion motion = rotation_->At(t_s);
    return motion.q_GI * motion.w_I.cross(lever_m_);
  }
  const std::unique_ptr<Trajectory> rotation_;
  const Eigen::Vector3d lever_m_;
};

struct Kind {
  std::string name;
  std::function<std::unique_ptr<Trajectory>(double, std::uint64_t)> make;
};

Kind Simple(const std::string& name, MotionKind kind) {
  return {name, [kind](double duration_s, std::uint64_t seed) {
            std::mt19937 random(static_cast<std::uint32_t>(seed));
            return RandomMotion(kind, duration_s, &random);
          }};
}

Kind PivotAt(const std::string& name, double lever_m) {
  return {name, [lever_m](double duration_s, std::uint64_t seed) {
            std::mt19937 random(static_cast<std::uint32_t>(seed));
            auto rotation =
                RandomMotion(MotionKind::kRotationOnly, duration_s, &random);
            return std::unique_ptr<Trajectory>(std::make_unique<Pivot>(
                std::move(rotation), lever_m * Eigen::Vector3d(2, -1, 2) / 3));
          }};
}

std::vector<Kind> Kinds() {
  const auto handheld = [](double excitation) {
    return [excitation](double duration_s, std::uint64_t seed) {
      return MakeHandheld(duration_s, excitation, seed);
    };
  };
  return {PivotAt("rotation, pivot at 0 cm", 0),
          PivotAt("rotation, pivot at 5 cm", 0.05),
          PivotAt("rotation, pivot at 50 cm", 0.5),
          Simple("one axis", MotionKind::kOneAxis),
          Simple("planar", MotionKind::kPlanar),
          Simple("hover", MotionKind::kHover),
          Simple("rest", MotionKind::kRest),
          {"calm", handheld(0.1)},
          {"hand-held", handheld(0.7)},
          {"mixed", [](double duration_s, std::uint64_t seed) {
             return MakeMixed(duration_s, seed);
           }}};
}

struct Counts {
  int segments = 0;
  int tested = 0;
  int alarms = 0;  // at the default rate
  int at_percent = 0;
  double statistic = 0, degrees = 0;

  Counts& operator+=(const Counts& other) {
    segments += other.segments;
    tested += other.tested;
    alarms += other.alarms;
    at_percent += other.at_percent;
    statistic += other.statistic;
    degrees += other.degrees;
    return *this;
  }
};

// [kind][0: at the active version, 1: elsewhere].
using CountsOfKinds = std::vector<std::array<Counts, 2>>;

CountsOfKinds Run(int index) {
  const ChangeDevice device =
      MakeChangeDevice(index, *MakeMixed(8 * kChangeSegment_s + 0.5, index));
  const ConsistencyTester tester(device.rig, device.active);
  const std::vector<Kind> kinds = Kinds();
  std::mt19937 random(static_cast<std::uint32_t>(index));
  std::uniform_real_distribution<double> uniform(-kReach, kReach);
  const Eigen::VectorXd reference = ReferenceSigmas(device.rig);
  Eigen::VectorXd off = Eigen::VectorXd::Zero(reference.size());
  for (const int i : FreeComponents(device.rig)) {
    off(i) = uniform(random) * reference(i);
  }
  const Calibration elsewhere = BoxPlus(device.active.theta, off);
  CountsOfKinds all(kinds.size());
  std::vector<OffsetInformation> newest[2];  // at the default rate, at 1 %
  for (const int place : {0, 1}) {
    const Calibration& slam = place == 0 ? device.active.theta : elsewhere;
    for (std::size_t k = 0; k < kinds.size(); ++k) {
      SimulationOptions options;
      options.seed = 100 * index + 50 * place + k;
      options.revisit_fraction = 0;
      const auto session =
          Simulate(device.rig,
                   device.truth,
                   slam,
                   *kinds[k].make(kEach * kChangeSegment_s + 0.5, options.seed),
                   "use",
                   options);
      Counts& counts = all[k][place];
      for (const MotionSegment& segment : session.segments) {
        ++counts.segments;
        const auto information = ScoreSegment(device.rig, slam, segment);
        if (!tester.Accepts(information)) continue;
        ++counts.tested;
        const OffsetInformation offset = tester.Offset(information);
        const ConsistencyTest alone = tester.Test(offset);
        counts.statistic += alone.statistic;
        counts.degrees += alone.degrees;
        for (const int often : {0, 1}) {
          newest[often].push_back(offset);
          ChangeOptions rate;
          if (often == 1) rate.false_alarm_rate = 0.01;
          if (!DetectChange(tester, newest[often], rate)) continue;
          newest[often].clear();
          (often == 1 ? counts.at_percent : counts.alarms) += 1;
        }
      }
    }
  }
  return all;
}

}  // namespace

void RunRotationFalseAlarms(Context* context) {
  const int devices = context->quick() ? 1 : 15;
  std::vector<CountsOfKinds> all(devices);
  context->ForEach(devices,
                   [&](int i) { all[i] = Run(kRotationFirstDevice + i); });
  ResultTable table({"motion",
                     "scored at",
                     "segments",
                     "tested",
                     "statistic / degrees",
                     "alarms at 1 %",
                     "alarms at the default rate"});
  const std::vector<Kind> kinds = Kinds();
  Counts sum;
  for (const int place : {0, 1}) {
    for (std::size_t k = 0; k < kinds.size(); ++k) {
      Counts counts;
      for (const CountsOfKinds& device : all) counts += device[k][place];
      table.Add({kinds[k].name,
                 std::string(place == 0 ? "the active version" : "another"),
                 static_cast<long>(counts.segments),
                 static_cast<long>(counts.tested),
                 counts.degrees > 0 ? Cell(counts.statistic / counts.degrees)
                                    : Cell(),
                 static_cast<long>(counts.at_percent),
                 static_cast<long>(counts.alarms)});
      sum += counts;
    }
  }
  context->WriteTable("rotation_false_alarms", table);
  context->AtMost("rotation_false_alarms.alarms",
                  sum.alarms,
                  0,
                  {.unit = "at 1e-5", .robust = true});
  context->AtMost("rotation_false_alarms.rate_at_1_percent",
                  static_cast<double>(sum.at_percent) / sum.tested,
                  0.01,
                  {.robust = true});
}

}  // namespace selfcal
