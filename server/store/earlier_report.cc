#include "server/store/earlier_report.h"

#include "proto/resource_names.h"

namespace selfcal::server {

v1::SolverReport Upgrade(const store::EarlierReport& earlier,
                         const std::string& rig) {
  v1::SolverReport report;
  report.set_outcome(static_cast<v1::SolverReport::Outcome>(earlier.outcome()));
  report.set_message(earlier.message());
  report.set_rank(earlier.rank());
  *report.mutable_held_constant() = earlier.held_constant();
  report.set_iterations(earlier.iterations());
  report.set_initial_cost(earlier.initial_cost());
  report.set_final_cost(earlier.final_cost());
  report.set_reprojection_rms_before_px(earlier.reprojection_rms_before_px());
  report.set_reprojection_rms_after_px(earlier.reprojection_rms_after_px());
  report.set_reprojection_median_before_px(
      earlier.reprojection_median_before_px());
  report.set_reprojection_median_after_px(
      earlier.reprojection_median_after_px());
  report.set_segments(earlier.segments());
  report.set_partitions(earlier.partitions());
  report.set_keyframes(earlier.keyframes());
  report.set_landmarks(earlier.landmarks());
  report.set_landmarks_dropped(earlier.landmarks_dropped());
  report.set_observations(earlier.observations());
  report.set_observations_dropped(earlier.observations_dropped());
  report.set_track_noise_factor(earlier.track_noise_factor());
  *report.mutable_noise_factors() = earlier.noise_factors();
  for (const store::EarlierReport::Fit& fit : earlier.fits()) {
    v1::SegmentFit* added = report.add_segment_fits();
    added->set_segment(SegmentName(rig, {fit.session(), fit.index()}));
    added->set_pixel_ratio(fit.pixel_ratio());
    added->set_inertial_ratio(fit.inertial_ratio());
    *added->mutable_others() = fit.others();
    added->set_excluded(fit.excluded());
  }
  *report.mutable_halves() = earlier.halves();
  *report.mutable_evicted() = earlier.evicted();
  return report;
}

}  // namespace selfcal::server
