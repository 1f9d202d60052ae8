// What segments say together about theta, joined at their ends: a filter over
// theta and the state of the newest keyframe, which takes a segment at a time.
//
// Segments of a session that follow each other directly are joined by the IMU
// samples between them; over a gap, their biases by the random walk; sessions
// by theta alone. Landmarks that continue from one segment to the next are two
// landmarks here.
//
// One object is for one thread. Deterministic.
#pragma once

#include <Eigen/Core>
#include <optional>

#include "core/information/fusion.h"
#include "core/information/segment_ends.h"
#include "core/model/calibration.h"
#include "core/model/rig.h"

namespace selfcal {

class SessionChain {
 public:
  // Information is about theta [-] point.
  SessionChain(const Rig& rig, const Calibration& point);

  // Segments in the order of time, each session in one run. `weight` in (0, 1]
  // is a factor on all that the segment says: the inverse of one on its
  // covariance. The segment must have the shape of the rig.
  void Add(const SegmentEnds& segment, double weight = 1);

  // theta random-walks by these variances (D, tangent units): what was added
  // so far says less of what it is from now on.
  void Age(const Eigen::VectorXd& variances);

  // Of all segments so far, the states of the newest eliminated.
  ThetaInformation Theta() const;

 private:
  // The end of the newest segment.
  struct End {
    SegmentKey key;
    KeyframeState state;
    std::vector<ImuSample> tail;
  };

  void AddLink(const SegmentEnds& segment);
  void AddGap(const SegmentEnds& segment);
  void Eliminate(int begin, int count);

  const Rig& rig_;
  const Calibration point_;
  const int theta_;  // D
  // Over theta and the state of the newest keyframe, if there is one; while a
  // segment is added also over its ends.
  Eigen::MatrixXd Lambda_;
  Eigen::VectorXd eta_;
  std::optional<End> end_;
};

}  // namespace selfcal
