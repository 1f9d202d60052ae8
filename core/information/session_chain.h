// The joint information of segments about theta, joined at their ends: a filter
// over theta and the state of the newest keyframe, to which segments are added
// one at a time.
//
// Segments of a session that follow each other directly are joined by the IMU
// samples between them; across a gap, their biases are joined by the random
// walk; sessions are joined by theta alone. A landmark that continues from one
// segment to the next is modelled as two landmarks.
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
  // The information is about theta [-] point.
  SessionChain(const Rig& rig, const Calibration& point);

  // Adds a segment. Segments come in the order of time, with those of a session
  // consecutive. `weight` in (0, 1] scales all information of the segment: its
  // inverse scales the covariance. The segment must have the shape of the rig.
  void Add(const SegmentEnds& segment, double weight = 1);

  // Adds a random walk of theta with these variances (D, tangent units):
  // segments added before have less information about theta from now on.
  void Age(const Eigen::VectorXd& variances);

  // Information of all segments so far, with the state of the newest keyframe
  // eliminated.
  ThetaInformation Theta() const;

 private:
  // The end of the newest segment.
  struct End {
    SegmentKey key;
    double temperature_c;
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
  // segment is being added, also over its ends.
  Eigen::MatrixXd Lambda_;
  Eigen::VectorXd eta_;
  std::optional<End> end_;
};

}  // namespace selfcal
