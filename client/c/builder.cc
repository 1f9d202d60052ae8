#include <fmt/format.h>

#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "client/c/boundary.h"
#include "client/c/calibration.h"
#include "client/c/options.h"
#include "client/c/segment.h"
#include "client/c/selfcal.h"
#include "client/selfcal/segment_builder.h"

struct selfcal_builder {
  selfcal::client::SegmentBuilder builder;
  // Reused by each keyframe.
  std::vector<selfcal::client::KeyframeObservation> observations = {};
};

namespace {

using selfcal::c::Guarded;
using selfcal::c::OrNull;
using selfcal::c::RequireNotNull;

Eigen::Vector3d ToVector(const double (&v)[3]) { return {v[0], v[1], v[2]}; }

selfcal::KeyframeState ToState(const selfcal_keyframe_state& given) {
  selfcal::KeyframeState state;
  const selfcal_quaternion& q = given.q_GI;
  state.t_ns = given.t_ns;
  state.q_GI = Eigen::Quaterniond(q.w, q.x, q.y, q.z);
  state.p_GI = ToVector(given.p_GI);
  state.v_GI = ToVector(given.v_GI);
  state.b_a = ToVector(given.b_a);
  state.b_g = ToVector(given.b_g);
  return state;
}

// INVALID_ARGUMENT for a reserved member that is set.
absl::Status ToObservations(
    const selfcal_observation* given,
    std::uint64_t count,
    std::vector<selfcal::client::KeyframeObservation>* observations) {
  observations->clear();
  observations->reserve(count);
  for (std::uint64_t i = 0; i < count; ++i) {
    const selfcal_observation& seen = given[i];
    if (seen.reserved != 0) {
      return absl::InvalidArgumentError(
          fmt::format("observations[{}].reserved: must be 0", i));
    }
    observations->push_back({seen.camera,
                             seen.landmark_id,
                             {seen.z_px[0], seen.z_px[1]},
                             ToVector(seen.p_G)});
  }
  return absl::OkStatus();
}

// Runs a call of the builder. If it returns false, memory ran out, or its input
// is refused for the reason `refusal`.
template <typename Call>
absl::Status Run(selfcal::client::SegmentBuilder* builder,
                 const char* refusal,
                 const Call& call) {
  const std::uint64_t failures = builder->statistics().out_of_memory;
  const bool accepted = call();
  // A call that is accepted can drop the segment, too.
  if (builder->statistics().out_of_memory != failures) throw std::bad_alloc();
  return accepted ? absl::OkStatus() : absl::OutOfRangeError(refusal);
}

using AddSampleMethod = bool (selfcal::client::SegmentBuilder::*)(
    const selfcal::ImuSample&) noexcept;

int32_t AddSample(AddSampleMethod method,
                  selfcal_builder* builder,
                  const selfcal_imu_sample* sample,
                  selfcal_error* error) {
  return Guarded(error, [&] {
    if (auto s = RequireNotNull(builder, "builder"); !s.ok()) return s;
    if (auto s = RequireNotNull(sample, "sample"); !s.ok()) return s;
    return Run(
        &builder->builder,
        "sample.t_ns: is not later than that of the sample before it",
        [&] {
          return (builder->builder.*method)(
              {sample->t_ns, ToVector(sample->gyro), ToVector(sample->accel)});
        });
  });
}

}  // namespace

int32_t selfcal_builder_create(const selfcal_builder_options* options,
                               selfcal_builder** builder,
                               selfcal_error* error) {
  if (builder != nullptr) *builder = nullptr;
  return Guarded(error, [&] {
    const auto converted = selfcal::c::ToOptions(options);
    if (!converted.ok()) return converted.status();
    auto status = RequireNotNull(builder, "builder");
    if (!status.ok()) return status;
    auto made = std::make_unique<selfcal_builder>(
        selfcal_builder{selfcal::client::SegmentBuilder(*converted)});
    // Only a builder that has no memory refuses this.
    if (!made->builder.SetTemperature(std::nullopt)) throw std::bad_alloc();
    *builder = made.release();
    return absl::OkStatus();
  });
}

void selfcal_builder_destroy(selfcal_builder* builder) { delete builder; }

int32_t selfcal_builder_add_imu(selfcal_builder* builder,
                                const selfcal_imu_sample* sample,
                                selfcal_error* error) {
  return AddSample(
      &selfcal::client::SegmentBuilder::AddImu, builder, sample, error);
}

int32_t selfcal_builder_add_second_imu(selfcal_builder* builder,
                                       const selfcal_imu_sample* sample,
                                       selfcal_error* error) {
  return AddSample(
      &selfcal::client::SegmentBuilder::AddSecondImu, builder, sample, error);
}

int32_t selfcal_builder_add_keyframe(selfcal_builder* builder,
                                     const selfcal_keyframe_state* state,
                                     const selfcal_observation* observations,
                                     uint64_t count,
                                     selfcal_error* error) {
  // Any time will do if there is no state: that is an error.
  return selfcal_builder_add_keyframe_at(builder,
                                         state,
                                         state == nullptr ? 0 : state->t_ns,
                                         observations,
                                         count,
                                         error);
}

int32_t selfcal_builder_add_keyframe_at(selfcal_builder* builder,
                                        const selfcal_keyframe_state* state,
                                        int64_t image_t_ns,
                                        const selfcal_observation* observations,
                                        uint64_t count,
                                        selfcal_error* error) {
  return Guarded(error, [&] {
    if (auto s = RequireNotNull(builder, "builder"); !s.ok()) return s;
    if (auto s = RequireNotNull(state, "state"); !s.ok()) return s;
    if (count > 0) {
      auto s = RequireNotNull(observations, "observations");
      if (!s.ok()) return s;
    }
    const auto limit =
        static_cast<std::uint64_t>(selfcal::SegmentLimits{}.max_observations);
    if (count > limit) {
      return absl::InvalidArgumentError(fmt::format(
          "count: is {}, a segment has at most {} observations", count, limit));
    }
    auto status = ToObservations(observations, count, &builder->observations);
    if (!status.ok()) return status;
    return Run(&builder->builder,
               "the keyframe is refused: it is not later than the keyframe "
               "before it, its state is more than 0.5 s from its images, or "
               "the SLAM system is not healthy",
               [&] {
                 return builder->builder.AddKeyframe(
                     ToState(*state), image_t_ns, builder->observations);
               });
  });
}

int32_t selfcal_builder_set_calibration_version(selfcal_builder* builder,
                                                int64_t version,
                                                selfcal_error* error) {
  return Guarded(error, [&] {
    if (auto s = RequireNotNull(builder, "builder"); !s.ok()) return s;
    return Run(&builder->builder, "", [&] {
      builder->builder.SetCalibrationVersion(version);
      return true;
    });
  });
}

int32_t selfcal_builder_set_theta(selfcal_builder* builder,
                                  const selfcal_calibration* calibration,
                                  selfcal_error* error) {
  return Guarded(error, [&] {
    if (auto s = RequireNotNull(builder, "builder"); !s.ok()) return s;
    auto status = RequireNotNull(calibration, "calibration");
    if (!status.ok()) return status;
    // A calibration is valid, so that only missing memory is left.
    const bool set =
        builder->builder.SetTheta(calibration->published->version.theta);
    if (!set) throw std::bad_alloc();
    return status;
  });
}

int32_t selfcal_builder_set_healthy(selfcal_builder* builder,
                                    int32_t healthy,
                                    selfcal_error* error) {
  return Guarded(error, [&] {
    auto status = RequireNotNull(builder, "builder");
    if (status.ok()) builder->builder.SetHealthy(healthy != 0);
    return status;
  });
}

int32_t selfcal_builder_set_temperature(selfcal_builder* builder,
                                        double celsius,
                                        selfcal_error* error) {
  return Guarded(error, [&] {
    if (auto s = RequireNotNull(builder, "builder"); !s.ok()) return s;
    return Run(&builder->builder, "celsius: must be from -100 to 200", [&] {
      return builder->builder.SetTemperature(celsius);
    });
  });
}

int32_t selfcal_builder_clear_temperature(selfcal_builder* builder,
                                          selfcal_error* error) {
  return Guarded(error, [&] {
    auto status = RequireNotNull(builder, "builder");
    if (status.ok()) builder->builder.SetTemperature(std::nullopt);
    return status;
  });
}

int32_t selfcal_builder_flush(selfcal_builder* builder,
                              int32_t min_keyframes,
                              selfcal_error* error) {
  return Guarded(error, [&] {
    if (auto s = RequireNotNull(builder, "builder"); !s.ok()) return s;
    return Run(&builder->builder, "", [&] {
      builder->builder.Flush(min_keyframes);
      return true;
    });
  });
}

selfcal_segment* selfcal_builder_take(selfcal_builder* builder) {
  if (builder == nullptr) return nullptr;
  return OrNull([&]() -> selfcal_segment* {
    // Memory comes first, so that no segment is lost without it.
    auto segment = std::make_unique<selfcal_segment>();
    auto closed = builder->builder.TakeClosed();
    if (!closed) return nullptr;
    segment->closed = *std::move(closed);
    return segment.release();
  });
}

int64_t selfcal_builder_next_index(const selfcal_builder* builder) {
  return builder == nullptr ? 0 : builder->builder.next_index();
}

int32_t selfcal_builder_get_statistics(const selfcal_builder* builder,
                                       selfcal_builder_statistics* statistics,
                                       selfcal_error* error) {
  return Guarded(error, [&] {
    if (auto s = RequireNotNull(builder, "builder"); !s.ok()) return s;
    const auto counts = builder->builder.statistics();
    selfcal_builder_statistics value = {};
    value.segments = counts.segments;
    value.keyframes_refused = counts.keyframes_refused;
    value.keyframes_dropped = counts.keyframes_dropped;
    value.keyframes_unhealthy = counts.keyframes_unhealthy;
    value.imu_ignored = counts.imu_ignored;
    value.observations_dropped = counts.observations_dropped;
    value.out_of_memory = counts.out_of_memory;
    return selfcal::c::Write(
        value, selfcal::c::kBuilderStatisticsSize, "statistics", statistics);
  });
}

int64_t selfcal_segment_index(const selfcal_segment* segment) {
  return segment == nullptr ? 0 : segment->closed.key.index;
}

void selfcal_segment_destroy(selfcal_segment* segment) { delete segment; }
