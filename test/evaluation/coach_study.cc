#include "test/evaluation/coach_study.h"

#include <algorithm>
#include <cmath>

#include "core/coach/advise.h"
#include "core/coach/predict.h"
#include "core/information/segment_information.h"
#include "core/simulation/random.h"
#include "core/simulation/simulate.h"
#include "test/core/simulation/rigs.h"

namespace selfcal {
namespace {

constexpr std::uint64_t kChoiceStream = 301;

// How well theta is known, as segments come.
class Knowledge {
 public:
  explicit Knowledge(const Rig& rig)
      : rig_(rig),
        free_(FreeComponents(rig)),
        reference_(ReferenceSigmas(rig)(free_)),
        Lambda_(PriorSigmas(rig).cwiseAbs2().cwiseInverse().asDiagonal()) {}

  void Add(const MotionSegment& segment) {
    Lambda_ += ScoreSegment(rig_, rig_.factory, segment).Lambda;
  }
  const Eigen::MatrixXd& Lambda() const { return Lambda_; }

  double LargestSigma() const {
    const Eigen::MatrixXd scaled = reference_.asDiagonal() *
                                   Lambda_(free_, free_) *
                                   reference_.asDiagonal();
    return std::sqrt(scaled.inverse().diagonal().maxCoeff());
  }

 private:
  const Rig& rig_;
  const std::vector<int> free_;
  const Eigen::VectorXd reference_;
  Eigen::MatrixXd Lambda_;
};

SimulationOptions Options(std::uint64_t seed) {
  SimulationOptions options;
  options.seed = seed;
  options.revisit_fraction = 0;
  return options;
}

// Of a body that moves between its keyframes as these say.
void MeasureVigour(CoachRecording* recording) {
  double rates = 0, accels = 0;
  int count = 0;
  for (const MotionSegment& segment : recording->segments) {
    for (std::size_t k = 1; k < segment.keyframes.size(); ++k) {
      const KeyframeState& a = segment.keyframes[k - 1];
      const KeyframeState& b = segment.keyframes[k];
      const double dt = static_cast<double>(b.t_ns - a.t_ns) * 1e-9;
      rates += std::pow(a.q_GI.angularDistance(b.q_GI) / dt, 2);
      accels += ((b.v_GI - a.v_GI) / dt).squaredNorm();
      ++count;
    }
  }
  recording->rms_rate_radps = std::sqrt(rates / count);
  recording->rms_accel_mps2 = std::sqrt(accels / count);
}

std::string NextMotion(const Rig& rig,
                       Way way,
                       const Predictions& predictions,
                       const Knowledge& knowledge,
                       Random* random) {
  if (way == Way::kCoached) {
    const Coaching coaching = Advise(rig, predictions, knowledge.Lambda());
    return std::string(coaching.advice.front().motion);
  }
  return std::string(
      Primitives()[1 + random->Index(Primitives().size() - 1)].name);
}

CoachRecording Perform(const CoachedDevice& device,
                       Way way,
                       int segments,
                       std::uint64_t seed) {
  CoachRecording recording;
  const Predictions predictions = Predict(device.rig, device.rig.factory);
  Knowledge knowledge(device.rig);
  Random random(seed, kChoiceStream);
  for (int i = 0; i < segments; ++i) {
    const std::string motion =
        NextMotion(device.rig, way, predictions, knowledge, &random);
    recording.motions.push_back(motion);
    recording.segments.push_back(SimulatePrimitive(
        device.rig,
        device.truth,
        device.rig.factory,
        *FindPrimitive(motion),
        Options(1000 * seed + static_cast<std::uint64_t>(i))));
    recording.segments.back().key.session += "-" + std::to_string(i);
    knowledge.Add(recording.segments.back());
    recording.largest.push_back(knowledge.LargestSigma());
  }
  return recording;
}

CoachRecording Carry(const CoachedDevice& device,
                     Way way,
                     int segments,
                     std::uint64_t seed) {
  CoachRecording recording;
  const SimulationOptions options = Options(1000 * seed);
  const double duration_s =
      (segments * options.keyframes_per_segment + 1) / options.keyframe_rate_hz;
  const auto trajectory = way == Way::kMixed
                              ? MakeMixed(duration_s, seed)
                              : MakeHandheld(duration_s, 1, seed);
  recording.segments = Simulate(device.rig,
                                device.truth,
                                device.rig.factory,
                                *trajectory,
                                "carried",
                                options)
                           .segments;
  Knowledge knowledge(device.rig);
  for (const MotionSegment& segment : recording.segments) {
    knowledge.Add(segment);
    recording.largest.push_back(knowledge.LargestSigma());
  }
  return recording;
}

}  // namespace

CoachedDevice MakeCoachedDevice(int rig, std::uint64_t seed) {
  CoachedDevice device;
  if (rig == 1) {
    device = {"two cameras", StereoRig(), {}};
  } else {
    device = {"one camera", HandheldRig("one"), {}};
  }
  if (rig == 2) {
    device.name = "one camera, time offset";
    device.rig.blocks = {{"*.time_offset", true}};
    device.rig.groups = DefaultGroups(device.rig.blocks);
    device.rig.factory.cameras[0].time_offset_s = 0.004;
  }
  device.truth = device.rig.factory;
  device.rig.factory = PerturbCalibration(device.truth, {}, seed);
  for (CameraCalibration& camera : device.rig.factory.cameras) {
    camera.time_offset_s = 0;
  }
  return device;
}

std::string NameOf(Way way) {
  switch (way) {
    case Way::kCoached:
      return "coached";
    case Way::kRandom:
      return "random motions";
    case Way::kVigorous:
      return "vigorous by hand";
    case Way::kMixed:
      break;
  }
  return "mixed by hand";
}

int CoachRecording::SegmentsTo(double target) const {
  const auto found =
      std::find_if(largest.begin(), largest.end(), [&](double sigma) {
        return sigma <= target;
      });
  return found == largest.end() ? 0
                                : static_cast<int>(found - largest.begin()) + 1;
}

int CoachRecording::Changes(int count) const {
  int changes = 0;
  for (int i = 1; i < count && i < static_cast<int>(motions.size()); ++i) {
    changes += motions[i] != motions[i - 1];
  }
  return changes;
}

CoachRecording Record(const CoachedDevice& device,
                      Way way,
                      int segments,
                      std::uint64_t seed) {
  const bool performed = way == Way::kCoached || way == Way::kRandom;
  CoachRecording recording = performed ? Perform(device, way, segments, seed)
                                       : Carry(device, way, segments, seed);
  const SimulationOptions options = Options(seed);
  recording.segment_s =
      options.keyframes_per_segment / options.keyframe_rate_hz;
  MeasureVigour(&recording);
  return recording;
}

}  // namespace selfcal
