#include "test/evaluation/experiments.h"

namespace selfcal {

// One file each: <name>_experiment.cc.
void RunAllSegments(Context* context);
void RunConsistency(Context* context);
void RunDatasets(Context* context);
void RunGainThreshold(Context* context);
void RunBatchMatch(Context* context);
void RunChange(Context* context);
void RunTurnCalm(Context* context);
void RunDriftFocal(Context* context);
void RunRotationFalseAlarms(Context* context);
void RunCoach(Context* context);
void RunEntropy(Context* context);
void RunGroups(Context* context);
void RunKeyframeRate(Context* context);
void RunRunTime(Context* context);
void RunRecordedChoice(Context* context);
void RunRecordings(Context* context);
void RunRecordingsRaw(Context* context);
void RunSensors(Context* context);
void RunFusion(Context* context);
void RunSelection(Context* context);
void RunNoiseFactors(Context* context);
void RunWrongNoise(Context* context);
void RunDegenerate(Context* context);
void RunTrust(Context* context);
void RunOpenVinsScenario(Context* context);
void RunOpenVinsRolling(Context* context);
void RunOpenVinsRollingBatch(Context* context);
void RunPopulation(Context* context);

const std::vector<Experiment>& Experiments() {
  static const std::vector<Experiment> all = {
      {"datasets",
       "the 15 datasets: motion, size, what their segments say",
       RunDatasets},
      {"gain_threshold",
       "the baseline of incremental information gain: its threshold",
       RunGainThreshold},
      {"batch_match",
       "informative segments against batch and information gain (Table I)",
       RunBatchMatch},
      {"change", "change of the device: false alarms and delay", RunChange},
      {"turn_calm",
       "a camera turned by 0.2 degrees between calm sessions, and calibrations "
       "on segments from before and after it",
       RunTurnCalm},
      {"drift_focal",
       "a focal length that drifts by a pixel in ten minutes",
       RunDriftFocal},
      {"rotation_false_alarms",
       "false alarms on motions that do not show all of theta, scored at the "
       "active version and elsewhere",
       RunRotationFalseAlarms},
      {"entropy", "does the entropy find informative segments?", RunEntropy},
      {"groups", "several groups of parameters against one", RunGroups},
      {"run_time", "run-time of each, side by side (Table II)", RunRunTime},
      {"recordings",
       "real recordings before and after; are sigmas honest there?",
       RunRecordings},
      {"recordings_raw",
       "rendered images and readings to calibrations, from a poor start",
       RunRecordingsRaw},
      {"recorded_choice",
       "which choice of segments does best on a real recording",
       RunRecordedChoice},
      {"sensors",
       "one, two and four cameras, with time offsets known, estimated, ignored",
       RunSensors},
      {"selection",
       "joint choices against tables, where one kind of motion dominates",
       RunSelection},
      {"fusion",
       "the estimate from stored information alone, against the full solve",
       RunFusion},
      {"all_segments",
       "calibrations with the information of all segments, against batch",
       RunAllSegments},
      {"consistency",
       "is each estimator as sure as it says? NEES and coverage",
       RunConsistency},
      {"keyframe_rate",
       "sparse and dense keyframes, lost IMU samples: NEES",
       RunKeyframeRate},
      {"noise_factors",
       "the factors by which the noise of a rig is off, found from residuals",
       RunNoiseFactors},
      {"wrong_noise",
       "estimate and sigma where the noise is wrong, or tracks are outlying",
       RunWrongNoise},
      {"degenerate",
       "motions that do not show all of theta: is what they do not show held",
       RunDegenerate},
      {"coach",
       "recorded time to a target sigma: following the coach, or carried about",
       RunCoach},
      {"trust",
       "devices of all kinds through the daemon's pipeline: silent failures",
       RunTrust},
      {"openvins_scenario",
       "tables and batch on the scenario of OpenVINS's simulator",
       RunOpenVinsScenario},
      {"openvins_rolling",
       "the same with a rolling shutter of unknown line delay",
       RunOpenVinsRolling},
      {"openvins_rolling_batch",
       "batch alone on 18 more seeds of it: chance, or more error than claimed",
       RunOpenVinsRollingBatch},
      {"population",
       "new devices of a cohort: segments to the target with its prior, and "
       "devices that are not like it",
       RunPopulation},
  };
  return all;
}

}  // namespace selfcal
