// The client of selfcald for C++11, on top of selfcal.h, which describes
// frames, units and defaults. Header-only: it needs the standard library and
// nothing else, with any options of the compiler (-march=native among them).
//
// A source file includes this header or those for C++20 (selfcal/client.h), not
// both; one program may have source files of either kind.
//
// Ownership: Objects can be moved, not copied, except Calibration, whose copies
// share one value. An object that was moved from, and an empty Segment or
// Calibration, can only be assigned, destroyed and tested.
//
// Errors: Constructors and functions throw selfcal::Error for invalid arguments
// and missing memory. What a program must expect while it runs is returned: a
// bool for input that is refused, a Status for the state of the connection, of
// the spool and of Drain.
//
// Threads: One thread at a time may use a Builder. All other objects can be
// used by several threads at once. Callbacks run one at a time on a thread of
// the library. They should be short, and must not destroy the object that calls
// them. Exceptions that a callback throws are caught and counted.
#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "client/c/selfcal.h"

namespace selfcal {
// Keeps these classes apart from those of the library in one program.
inline namespace cxx11 {

// A selfcal_code with its message.
class Status {
 public:
  Status() : code_(SELFCAL_OK) {}
  explicit Status(const selfcal_error& error)
      : code_(error.code), message_(error.message) {}

  bool ok() const { return code_ == SELFCAL_OK; }
  std::int32_t code() const { return code_; }
  const std::string& message() const { return message_; }

 private:
  std::int32_t code_;
  std::string message_;
};

class Error : public std::runtime_error {
 public:
  explicit Error(const selfcal_error& error)
      : std::runtime_error(error.message), code_(error.code) {}

  std::int32_t code() const { return code_; }  // a selfcal_code

 private:
  std::int32_t code_;
};

using Quaternion = selfcal_quaternion;
using ImuSample = selfcal_imu_sample;
using KeyframeState = selfcal_keyframe_state;
using Observation = selfcal_observation;

// An observation of a track that has no position: it is triangulated.
inline Observation ObservationOfTrack(std::uint64_t track,
                                      std::int32_t camera,
                                      double u_px,
                                      double v_px) {
  const double none = std::numeric_limits<double>::quiet_NaN();
  return {track, camera, 0, {u_px, v_px}, {none, none, none}};
}

namespace internal {

// Throws Error unless the code is SELFCAL_OK.
inline void Check(std::int32_t code, const selfcal_error& error) {
  if (code != SELFCAL_OK) throw Error(error);
}

// Returns false for `refusal`, and throws Error for any other error.
inline bool Accepted(std::int32_t code,
                     std::int32_t refusal,
                     const selfcal_error& error) {
  if (code == refusal) return false;
  Check(code, error);
  return true;
}

// A struct of selfcal.h with its size, all other members zero.
template <typename Struct>
Struct Sized() {
  Struct value = Struct();
  value.struct_size = static_cast<std::uint32_t>(sizeof(Struct));
  return value;
}

// The default for an empty string.
inline const char* OrDefault(const std::string& text) {
  return text.empty() ? nullptr : text.c_str();
}

}  // namespace internal

// One version of a rig's calibration, or none.
class Calibration {
 public:
  Calibration() = default;
  // Takes over the handle, which may be null.
  explicit Calibration(selfcal_calibration* handle) {
    if (handle != nullptr) handle_.reset(handle, &selfcal_calibration_destroy);
  }
  // A calibration of the SLAM system's own (selfcal_calibration_create).
  // Structs without struct_size get theirs.
  Calibration(selfcal_imu imu, std::vector<selfcal_camera> cameras) {
    imu.struct_size = static_cast<std::uint32_t>(sizeof(imu));
    std::vector<const selfcal_camera*> pointers;
    for (selfcal_camera& camera : cameras) {
      camera.struct_size = static_cast<std::uint32_t>(sizeof(camera));
      pointers.push_back(&camera);
    }
    selfcal_calibration* made = nullptr;
    selfcal_error error;
    internal::Check(
        selfcal_calibration_create(&imu,
                                   pointers.data(),
                                   static_cast<std::int32_t>(pointers.size()),
                                   &made,
                                   &error),
        error);
    handle_.reset(made, &selfcal_calibration_destroy);
  }

  // With other values of one parameter block, e.g. "imu.gyro.g_sensitivity"
  // (selfcal_calibration_with_block).
  Calibration WithBlock(const std::string& name,
                        const std::vector<double>& values) const {
    selfcal_calibration* with = nullptr;
    selfcal_error error;
    internal::Check(selfcal_calibration_with_block(handle_.get(),
                                                   name.c_str(),
                                                   values.data(),
                                                   values.size(),
                                                   &with,
                                                   &error),
                    error);
    return Calibration(with);
  }

  explicit operator bool() const { return handle_ != nullptr; }
  const selfcal_calibration* get() const { return handle_.get(); }
  std::int64_t version() const {
    return selfcal_calibration_version(handle_.get());
  }
  // A selfcal_calibration_verdict, and the reasons for it.
  std::int32_t verdict() const {
    return selfcal_calibration_get_verdict(handle_.get());
  }
  std::vector<std::string> reasons() const {
    std::vector<std::string> reasons;
    const std::int32_t count = selfcal_calibration_reason_count(handle_.get());
    for (std::int32_t i = 0; i < count; ++i) {
      reasons.emplace_back(selfcal_calibration_reason(handle_.get(), i));
    }
    return reasons;
  }
  std::int32_t camera_count() const {
    return selfcal_calibration_camera_count(handle_.get());
  }

  // At a temperature [degrees Celsius] (selfcal_calibration_at_temperature).
  Calibration AtTemperature(double temperature_c) const {
    selfcal_calibration* at = nullptr;
    selfcal_error error;
    internal::Check(selfcal_calibration_at_temperature(
                        handle_.get(), temperature_c, &at, &error),
                    error);
    return Calibration(at);
  }

  selfcal_imu imu() const {
    auto imu = internal::Sized<selfcal_imu>();
    selfcal_error error;
    internal::Check(selfcal_calibration_get_imu(handle_.get(), &imu, &error),
                    error);
    return imu;
  }

  selfcal_camera camera(std::int32_t index) const {
    auto camera = internal::Sized<selfcal_camera>();
    selfcal_error error;
    internal::Check(
        selfcal_calibration_get_camera(handle_.get(), index, &camera, &error),
        error);
    return camera;
  }

  // Names, units, values and sigmas. Names and units are valid as long as a
  // copy of this calibration.
  std::vector<selfcal_component> components() const {
    std::vector<selfcal_component> components(
        static_cast<std::size_t>(
            selfcal_calibration_component_count(handle_.get())),
        internal::Sized<selfcal_component>());
    selfcal_error error;
    for (std::size_t i = 0; i < components.size(); ++i) {
      internal::Check(
          selfcal_calibration_get_component(handle_.get(),
                                            static_cast<std::int32_t>(i),
                                            &components[i],
                                            &error),
          error);
    }
    return components;
  }

  // Covariance of the D components, D x D row by row; empty if not known.
  std::vector<double> covariance() const {
    const auto size = static_cast<std::size_t>(
        selfcal_calibration_component_count(handle_.get()));
    std::vector<double> covariance(size * size);
    selfcal_error error;
    const bool known =
        internal::Accepted(selfcal_calibration_get_covariance(
                               handle_.get(),
                               covariance.data(),
                               static_cast<std::uint64_t>(covariance.size()),
                               &error),
                           SELFCAL_FAILED_PRECONDITION,
                           error);
    return known ? covariance : std::vector<double>();
  }

  // Angular rate w_I [rad/s] and specific force f_I [m/s^2] in the body frame,
  // from readings and biases, with dw/dt = 0.
  void CorrectImu(const double (&gyro)[3],
                  const double (&accel)[3],
                  const double (&b_g)[3],
                  const double (&b_a)[3],
                  double (&w_I)[3],
                  double (&f_I)[3]) const {
    const double dw_I[3] = {0, 0, 0};
    CorrectImu(gyro, accel, b_g, b_a, dw_I, w_I, f_I);
  }
  // The same at an angular acceleration (selfcal_calibration_correct_imu_dw).
  void CorrectImu(const double (&gyro)[3],
                  const double (&accel)[3],
                  const double (&b_g)[3],
                  const double (&b_a)[3],
                  const double (&dw_I)[3],
                  double (&w_I)[3],
                  double (&f_I)[3]) const {
    selfcal_error error;
    internal::Check(
        selfcal_calibration_correct_imu_dw(
            handle_.get(), gyro, accel, b_g, b_a, dw_I, w_I, f_I, &error),
        error);
  }

  // Changes the biases of a filter that takes this calibration instead of
  // `from` (selfcal_calibration_carry_biases).
  void CarryBiases(const Calibration& from,
                   const double (&f_I)[3],
                   double (&b_g)[3],
                   double (&b_a)[3]) const {
    selfcal_error error;
    internal::Check(selfcal_calibration_carry_biases(
                        from.get(), handle_.get(), f_I, b_g, b_a, &error),
                    error);
  }

  // Return false and change nothing if the model has no answer, or there is no
  // such camera (selfcal_calibration_project, _unproject).
  bool Project(std::int32_t camera,
               const double (&p_C)[3],
               double (&z_px)[2]) const {
    selfcal_error error;
    return internal::Accepted(
        selfcal_calibration_project(handle_.get(), camera, p_C, z_px, &error),
        SELFCAL_OUT_OF_RANGE,
        error);
  }
  bool Unproject(std::int32_t camera,
                 const double (&z_px)[2],
                 double (&bearing_C)[3]) const {
    selfcal_error error;
    return internal::Accepted(
        selfcal_calibration_unproject(
            handle_.get(), camera, z_px, bearing_C, &error),
        SELFCAL_OUT_OF_RANGE,
        error);
  }

 private:
  std::shared_ptr<const selfcal_calibration> handle_;
};

// A complete segment, or none.
class Segment {
 public:
  Segment() : handle_(nullptr, &selfcal_segment_destroy) {}
  // Takes over the handle, which may be null.
  explicit Segment(selfcal_segment* handle)
      : handle_(handle, &selfcal_segment_destroy) {}

  explicit operator bool() const { return handle_ != nullptr; }
  // Index within its session.
  std::int64_t index() const { return selfcal_segment_index(handle_.get()); }
  selfcal_segment* release() { return handle_.release(); }

 private:
  std::unique_ptr<selfcal_segment, void (*)(selfcal_segment*)> handle_;
};

// 0 and an empty string mean the default, which selfcal_builder_options states.
struct BuilderOptions {
  std::string session;  // required
  std::int64_t first_index = 0;
  std::int64_t calibration_version = 0;
  std::int32_t keyframes = 0;
  double seconds = 0;
  std::int32_t min_observations = 0;
  double max_gap_s = 0;
  std::int32_t min_keyframes = 0;
  double pixel_sigma_px = 0;
  double gravity_mps2 = 0;
  bool same_ids_after_gap = false;
};

// Builds motion segments from keyframes (selfcal_builder). Send what is
// complete after each call:
//   while (selfcal::Segment segment = builder.Take()) {
//     stream.Send(std::move(segment));
//   }
class Builder {
 public:
  explicit Builder(const BuilderOptions& options)
      : handle_(Create(options), &selfcal_builder_destroy) {}

  // Returns false and ignores a sample that is not later than the one before.
  bool AddImu(const ImuSample& sample) {
    selfcal_error error;
    return internal::Accepted(
        selfcal_builder_add_imu(handle_.get(), &sample, &error),
        SELFCAL_OUT_OF_RANGE,
        error);
  }

  // The same of a second IMU (selfcal_builder_add_second_imu).
  bool AddSecondImu(const ImuSample& sample) {
    selfcal_error error;
    return internal::Accepted(
        selfcal_builder_add_second_imu(handle_.get(), &sample, &error),
        SELFCAL_OUT_OF_RANGE,
        error);
  }

  // Returns false and refuses a keyframe that is not later than the one before,
  // or comes while the SLAM system is not healthy.
  bool AddKeyframe(const KeyframeState& state,
                   const std::vector<Observation>& observations) {
    return AddKeyframe(state, state.t_ns, observations);
  }
  // The same for a state that holds at another time than its images, which have
  // the timestamp image_t_ns (selfcal_builder_add_keyframe_at).
  bool AddKeyframe(const KeyframeState& state,
                   std::int64_t image_t_ns,
                   const std::vector<Observation>& observations) {
    selfcal_error error;
    return internal::Accepted(
        selfcal_builder_add_keyframe_at(handle_.get(),
                                        &state,
                                        image_t_ns,
                                        observations.data(),
                                        observations.size(),
                                        &error),
        SELFCAL_OUT_OF_RANGE,
        error);
  }

  // Version of the calibration with which the states from the next keyframe on
  // are estimated (selfcal_builder_set_calibration_version).
  void SetCalibrationVersion(std::int64_t version) {
    selfcal_error error;
    internal::Check(
        selfcal_builder_set_calibration_version(handle_.get(), version, &error),
        error);
  }

  // Values of that calibration, or of the SLAM system's own
  // (selfcal_builder_set_theta); an empty one is an error.
  void SetTheta(const Calibration& calibration) {
    selfcal_error error;
    internal::Check(
        selfcal_builder_set_theta(handle_.get(), calibration.get(), &error),
        error);
  }

  // False drops the current segment and refuses keyframes until it is true
  // again (selfcal_builder_set_healthy).
  void SetHealthy(bool healthy) {
    selfcal_error error;
    internal::Check(
        selfcal_builder_set_healthy(handle_.get(), healthy ? 1 : 0, &error),
        error);
  }

  // Temperature of the device [degrees Celsius] from now on. Returns false and
  // ignores one that is not from -100 to 200.
  bool SetTemperature(double celsius) {
    selfcal_error error;
    return internal::Accepted(
        selfcal_builder_set_temperature(handle_.get(), celsius, &error),
        SELFCAL_OUT_OF_RANGE,
        error);
  }
  // The temperature is unknown from now on, as it is at first.
  void ClearTemperature() {
    selfcal_error error;
    internal::Check(selfcal_builder_clear_temperature(handle_.get(), &error),
                    error);
  }

  // Ends the current segment, at the end of a session or where tracking was
  // lost; with fewer keyframes than max(2, min_keyframes) it is dropped.
  void Flush(std::int32_t min_keyframes) {
    selfcal_error error;
    internal::Check(selfcal_builder_flush(handle_.get(), min_keyframes, &error),
                    error);
  }

  // The oldest complete segment, or none.
  Segment Take() { return Segment(selfcal_builder_take(handle_.get())); }

  // Index of the next segment.
  std::int64_t next_index() const {
    return selfcal_builder_next_index(handle_.get());
  }

  selfcal_builder_statistics statistics() const {
    auto statistics = internal::Sized<selfcal_builder_statistics>();
    selfcal_error error;
    internal::Check(
        selfcal_builder_get_statistics(handle_.get(), &statistics, &error),
        error);
    return statistics;
  }

 private:
  static selfcal_builder* Create(const BuilderOptions& given) {
    auto options = internal::Sized<selfcal_builder_options>();
    options.session = internal::OrDefault(given.session);
    options.first_index = given.first_index;
    options.calibration_version = given.calibration_version;
    options.keyframes = given.keyframes;
    options.seconds = given.seconds;
    options.min_observations = given.min_observations;
    options.max_gap_s = given.max_gap_s;
    options.min_keyframes = given.min_keyframes;
    options.pixel_sigma_px = given.pixel_sigma_px;
    options.gravity_mps2 = given.gravity_mps2;
    options.same_ids_after_gap = given.same_ids_after_gap ? 1 : 0;
    selfcal_builder* builder = nullptr;
    selfcal_error error;
    internal::Check(selfcal_builder_create(&options, &builder, &error), error);
    return builder;
  }

  std::unique_ptr<selfcal_builder, void (*)(selfcal_builder*)> handle_;
};

// 0 and an empty string mean the default, which selfcal_client_options states.
struct ClientOptions {
  std::string target;
  std::string rig;  // required
  std::int32_t max_queue = 0;
  std::int32_t max_unacknowledged = 0;
  std::chrono::milliseconds min_backoff{0};
  std::chrono::milliseconds max_backoff{0};
  std::string ca_file;
  std::string certificate_file;
  std::string key_file;
  std::string spool_dir;
  std::uint64_t max_spool_bytes = 0;
};

// One violated rule: the field, and what to do.
struct Violation {
  std::string field;
  std::string message;
};

// The daemon's verdict on one segment.
struct Acknowledgement {
  std::string session;
  std::int64_t index = 0;
  selfcal_verdict verdict = SELFCAL_REJECTED;
  std::vector<Violation> violations;  // the reasons for a rejection
  // Observations outside the image, and readings of the IMU beyond its full
  // scale, that were left out of a stored segment.
  std::uint64_t observations_dropped = 0;
  std::uint64_t readings_dropped = 0;
};

namespace internal {

// Valid as long as the given options.
inline selfcal_client_options ToC(const ClientOptions& given) {
  auto options = Sized<selfcal_client_options>();
  options.target = OrDefault(given.target);
  options.rig = OrDefault(given.rig);
  options.max_queue = given.max_queue;
  options.max_unacknowledged = given.max_unacknowledged;
  options.min_backoff_ms = given.min_backoff.count();
  options.max_backoff_ms = given.max_backoff.count();
  options.ca_file = OrDefault(given.ca_file);
  options.certificate_file = OrDefault(given.certificate_file);
  options.key_file = OrDefault(given.key_file);
  options.spool_dir = OrDefault(given.spool_dir);
  options.max_spool_bytes = given.max_spool_bytes;
  return options;
}

inline Acknowledgement FromC(const selfcal_acknowledgement& given) {
  Acknowledgement ack;
  ack.session = given.session;
  ack.index = given.index;
  ack.verdict = static_cast<selfcal_verdict>(given.verdict);
  ack.observations_dropped = given.observations_dropped;
  ack.readings_dropped = given.readings_dropped;
  for (std::uint64_t i = 0; i < given.violation_count; ++i) {
    ack.violations.push_back(
        {given.violations[i].field, given.violations[i].message});
  }
  return ack;
}

}  // namespace internal

// Sends segments to the daemon, in order and at least once (selfcal_stream).
class Stream {
 public:
  using AckCallback = std::function<void(const Acknowledgement&)>;

  explicit Stream(const ClientOptions& options,
                  AckCallback on_ack = AckCallback())
      : state_(new State(std::move(on_ack))) {
    const selfcal_client_options given = internal::ToC(options);
    selfcal_stream* stream = nullptr;
    selfcal_error error;
    internal::Check(
        selfcal_stream_create(&given,
                              state_->on_ack ? &Stream::CallBack : nullptr,
                              state_.get(),
                              &stream,
                              &error),
        error);
    state_->handle.reset(stream);
  }

  // Queues a segment and takes it over; an empty one is an error. Returns false
  // if memory and spool are full or the stream has ended: the segment is then
  // dropped and counted.
  bool Send(Segment segment) {
    selfcal_error error;
    return internal::Accepted(
        selfcal_stream_send(handle(), segment.release(), &error),
        SELFCAL_RESOURCE_EXHAUSTED,
        error);
  }

  // Waits until all segments are acknowledged; the only function that waits.
  // Must not be called from a callback. For the codes see selfcal_stream_drain.
  Status Drain(std::chrono::milliseconds timeout) {
    selfcal_error error;
    selfcal_stream_drain(handle(), timeout.count(), &error);
    return Status(error);
  }

  selfcal_stream_statistics statistics() const {
    auto statistics = internal::Sized<selfcal_stream_statistics>();
    selfcal_error error;
    internal::Check(
        selfcal_stream_get_statistics(handle(), &statistics, &error), error);
    statistics.callback_failures += state_->failures;
    return statistics;
  }

  // OK, or the last error while the connection is down.
  Status connection_status() const {
    selfcal_error error;
    selfcal_stream_connection_status(handle(), &error);
    return Status(error);
  }

  // OK, or the error of the last attempt to use the spool.
  Status spool_status() const {
    selfcal_error error;
    selfcal_stream_spool_status(handle(), &error);
    return Status(error);
  }

 private:
  // Stays where it is when the stream is moved.
  struct State {
    explicit State(AckCallback callback)
        : on_ack(std::move(callback)),
          failures(0),
          handle(nullptr, &selfcal_stream_destroy) {}
    const AckCallback on_ack;
    std::atomic<std::uint64_t> failures;
    // Last: it calls back until it is destroyed.
    std::unique_ptr<selfcal_stream, void (*)(selfcal_stream*)> handle;
  };

  static void CallBack(const selfcal_acknowledgement* ack, void* user) {
    auto* const state = static_cast<State*>(user);
    try {
      state->on_ack(internal::FromC(*ack));
    } catch (...) {
      ++state->failures;
    }
  }

  selfcal_stream* handle() const { return state_->handle.get(); }

  std::unique_ptr<State> state_;
};

// Watches the active calibration of a rig (selfcal_watch).
class Watch {
 public:
  using Callback = std::function<void(const Calibration&)>;

  // Without a callback, Newest returns what has come.
  explicit Watch(const ClientOptions& options, Callback on_new = Callback())
      : state_(new State(std::move(on_new))) {
    const selfcal_client_options given = internal::ToC(options);
    selfcal_watch* watch = nullptr;
    selfcal_error error;
    internal::Check(
        selfcal_watch_create(&given,
                             state_->on_new ? &Watch::CallBack : nullptr,
                             state_.get(),
                             &watch,
                             &error),
        error);
    state_->handle.reset(watch);
  }

  // The newest version that the daemon has sent; empty if there is none yet.
  Calibration Newest() const {
    return Calibration(selfcal_watch_newest(handle()));
  }

  // OK, or the last error of the connection while it is down.
  Status connection_status() const {
    selfcal_error error;
    selfcal_watch_connection_status(handle(), &error);
    return Status(error);
  }

  // Callbacks that threw.
  std::uint64_t callback_failures() const { return state_->failures; }

 private:
  // Stays where it is when the watch is moved.
  struct State {
    explicit State(Callback callback)
        : on_new(std::move(callback)),
          failures(0),
          handle(nullptr, &selfcal_watch_destroy) {}
    const Callback on_new;
    std::atomic<std::uint64_t> failures;
    // Last: it calls back until it is destroyed.
    std::unique_ptr<selfcal_watch, void (*)(selfcal_watch*)> handle;
  };

  static void CallBack(const selfcal_calibration* calibration, void* user) {
    auto* const state = static_cast<State*>(user);
    try {
      state->on_new(Calibration(selfcal_calibration_copy(calibration)));
    } catch (...) {
      ++state->failures;
    }
  }

  selfcal_watch* handle() const { return state_->handle.get(); }

  std::unique_ptr<State> state_;
};

}  // namespace cxx11
}  // namespace selfcal
