// The client of selfcald for programs that cannot use C++20, Eigen or Abseil:
// plain C99, and the base of selfcal.hpp for C++11. It streams motion segments
// to the daemon and receives calibrations, and never blocks the caller.
//
// Frames: G is gravity-aligned (z up) and constant during a session, I is the
// body (gyroscope) frame, A the accelerometer, C a camera (z forward). q_GI
// rotates from I to G, and p_GI is the position of I in G. Quaternions are unit
// Hamilton quaternions with named members; times are nanoseconds of one clock
// during a session.
//
// Structs: A struct that begins with struct_size may grow at its end in later
// versions. Set all of it to zero, and struct_size to its sizeof
// (SELFCAL_INIT); members that stay zero or NULL have their default. A library
// that is older than the header refuses members that it does not know, unless
// they are zero. All other structs never change. Members named `reserved` must
// be zero.
//
// Ownership: The library copies all that it is given. An object that a function
// returns is destroyed with the function of its kind. What a callback is given
// is valid until the callback returns.
//
// Errors: A function that returns int32_t returns SELFCAL_OK or another
// selfcal_code, and fills *error, which may be NULL. A null or invalid argument
// is SELFCAL_INVALID_ARGUMENT, and missing memory SELFCAL_RESOURCE_EXHAUSTED;
// the functions list what else they return. A function that fails changes
// nothing else, and sets the object that it would return to NULL. Exceptions do
// not leave the library. Functions that return another type accept NULL, as
// they state.
//
// Threads: One thread at a time may use a builder. All other objects can be
// used by several threads at once. An object is destroyed once, when no other
// thread uses it. Callbacks run one at a time on a thread of the library. They
// should be short, must not destroy the object that calls them, and must not
// throw.
//
// Compatibility: Programs that were linked with one version of libselfcal.so.0
// run with all later ones: functions are added, and never changed or removed.
#pragma once

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

// A struct with its size, all other members zero:
//   selfcal_client_options options = SELFCAL_INIT(selfcal_client_options);
// C only.
#define SELFCAL_INIT(type) ((type){.struct_size = (uint32_t)sizeof(type)})

// Codes of errors, with the numbers of gRPC. The daemon may return others of
// gRPC's.
enum selfcal_code {
  SELFCAL_OK = 0,
  SELFCAL_INVALID_ARGUMENT = 3,
  SELFCAL_DEADLINE_EXCEEDED = 4,
  SELFCAL_NOT_FOUND = 5,
  SELFCAL_PERMISSION_DENIED = 7,
  SELFCAL_RESOURCE_EXHAUSTED = 8,
  SELFCAL_FAILED_PRECONDITION = 9,
  SELFCAL_OUT_OF_RANGE = 11,
  SELFCAL_INTERNAL = 13,
  SELFCAL_UNAVAILABLE = 14,
  SELFCAL_DATA_LOSS = 15,
  SELFCAL_UNAUTHENTICATED = 16
};

typedef struct selfcal_error {
  int32_t code;       // a selfcal_code
  char message[508];  // UTF-8, cut to this size; empty for SELFCAL_OK
} selfcal_error;

// Version of the library that the program runs with, e.g. "0.1.0".
const char* selfcal_version(void);

// ---------------------------------------------------------------- Input data

typedef struct selfcal_quaternion {
  double w;
  double x;
  double y;
  double z;
} selfcal_quaternion;

// Raw readings; biases and intrinsics are not corrected.
typedef struct selfcal_imu_sample {
  int64_t t_ns;
  double gyro[3];   // [rad/s]
  double accel[3];  // [m/s^2]; +9.81 along the axis that points up, at rest
} selfcal_imu_sample;

// State of the body at the time of a keyframe, as the SLAM system estimated it.
// t_ns is the timestamp of the images; selfcal_builder_add_keyframe_at takes
// states of other times.
typedef struct selfcal_keyframe_state {
  int64_t t_ns;
  selfcal_quaternion q_GI;
  double p_GI[3];  // [m]
  double v_GI[3];  // [m/s], in G
  double b_a[3];   // bias of the accelerometer [m/s^2], in A
  double b_g[3];   // bias of the gyroscope [rad/s], in I
} selfcal_keyframe_state;

// One observation of a landmark in a keyframe.
typedef struct selfcal_observation {
  // Id of the landmark, or of the track if the SLAM system has no landmark; ids
  // may start again after a break (selfcal_builder).
  uint64_t landmark_id;
  int32_t camera;  // index into the rig's cameras
  uint32_t reserved;
  double z_px[2];  // pixel in the image as it was taken, with its distortion
  // Estimated position of the landmark [m]; not finite (NaN) if there is none.
  // A landmark that has a position in no keyframe of a segment is triangulated,
  // if the builder knows the calibration (selfcal_builder_set_theta), and left
  // out otherwise.
  double p_G[3];
} selfcal_observation;

// One version of a rig's calibration, with the verdict on it at the time. It
// never changes.
typedef struct selfcal_calibration selfcal_calibration;

// ------------------------------------------------------------------- Builder

// Builds motion segments from keyframes.
//
// Add every IMU sample, and every keyframe with its observations, each in order
// of time; either may run ahead of the other by up to max_gap_s. A segment is
// complete when it has its number of keyframes (or seconds), the keyframe after
// it has arrived, and the IMU samples have reached that keyframe, and 0.15 s
// beyond the last one of the segment. Take complete segments after each call,
// and send them:
//   while ((segment = selfcal_builder_take(builder)) != NULL) {
//     selfcal_stream_send(stream, segment, &error);
//   }
// Each call takes microseconds. When memory runs out, the current segment is
// dropped and counted.
//
// Ids of landmarks may denote other landmarks, and G may be another frame,
// after a break: after selfcal_builder_set_healthy, and after a time without
// keyframes of over max_gap_s, unless same_ids_after_gap is set.
typedef struct selfcal_builder selfcal_builder;

// A complete segment.
typedef struct selfcal_segment selfcal_segment;

typedef struct selfcal_builder_options {
  uint32_t struct_size;
  int32_t keyframes;  // in a segment, at least 2; default 40
  // Landmarks with fewer observations in the segment are excluded; default 3.
  int32_t min_observations;
  // Segments with fewer keyframes are dropped where they end at a gap;
  // default 10.
  int32_t min_keyframes;
  // Name of this run of the SLAM system, 1 to 128 printable ASCII characters;
  // together with the rig and the index it identifies a segment. Required.
  const char* session;
  int64_t first_index;  // of the first segment; default 0
  // Version of the calibration that the SLAM system uses; default 1, the
  // factory calibration.
  int64_t calibration_version;
  double seconds;    // if > 0, duration of a segment, instead of keyframes
  double max_gap_s;  // largest time between keyframes of a segment; default 10
  // Standard deviation of an observation, used in triangulation; default 1.
  double pixel_sigma_px;
  double gravity_mps2;  // of the SLAM system, along -z of G; default 9.81
  // Not 0: ids of landmarks after a gap denote the same landmarks as before it,
  // as those of a SLAM system with a map do.
  int32_t same_ids_after_gap;
  uint32_t reserved;
  // The time at which the session began, for a builder that continues one;
  // default: that of the first keyframe. The time offset of a camera whose
  // clock drifts is that of this time.
  int64_t session_start_ns;
} selfcal_builder_options;

typedef struct selfcal_builder_statistics {
  uint32_t struct_size;
  uint32_t reserved;
  uint64_t segments;  // completed
  // Keyframes that were not later than the keyframe before them, or with a
  // state too far from its images.
  uint64_t keyframes_refused;
  // Keyframes that were accepted but are in no segment: no IMU sample covers
  // them, their segment was too short when it was flushed, only one came
  // between two versions, or memory ran out.
  uint64_t keyframes_dropped;
  // Keyframes that were in the current segment when the SLAM system became
  // unhealthy, or came while it was.
  uint64_t keyframes_unhealthy;
  // IMU samples that were not later than the sample before them.
  uint64_t imu_ignored;
  // Observations outside the image, or not finite.
  uint64_t observations_dropped;
  // Calls that ran out of memory; each dropped the current segment.
  uint64_t out_of_memory;
} selfcal_builder_statistics;

int32_t selfcal_builder_create(const selfcal_builder_options* options,
                               selfcal_builder** builder,
                               selfcal_error* error);
// Segments that were not taken are lost. NULL is ignored.
void selfcal_builder_destroy(selfcal_builder* builder);

// SELFCAL_OUT_OF_RANGE: the sample is not later than the one before it, and is
// ignored.
int32_t selfcal_builder_add_imu(selfcal_builder* builder,
                                const selfcal_imu_sample* sample,
                                selfcal_error* error);

// The same of a second IMU, for a rig that has one. Once a sample was added,
// segments wait for its samples as for those of the first one, and keyframes
// that they do not cover are dropped.
int32_t selfcal_builder_add_second_imu(selfcal_builder* builder,
                                       const selfcal_imu_sample* sample,
                                       selfcal_error* error);

// Adds a keyframe with `count` observations, which may be NULL if there are
// none. If a camera observes a landmark several times, the first observation is
// used; the last p_G of a landmark within the segment is sent.
// SELFCAL_OUT_OF_RANGE: the keyframe is refused, because it is not later than
// the one before it, or the SLAM system is not healthy.
int32_t selfcal_builder_add_keyframe(selfcal_builder* builder,
                                     const selfcal_keyframe_state* state,
                                     const selfcal_observation* observations,
                                     uint64_t count,
                                     selfcal_error* error);

// Adds a keyframe whose images have the timestamp image_t_ns and whose state
// holds at another time, state->t_ns: for a filter that estimates its state at
// the exposure. The state is moved along the IMU samples to image_t_ns.
// SELFCAL_OUT_OF_RANGE: as above, or the times are more than 0.5 s apart.
int32_t selfcal_builder_add_keyframe_at(selfcal_builder* builder,
                                        const selfcal_keyframe_state* state,
                                        int64_t image_t_ns,
                                        const selfcal_observation* observations,
                                        uint64_t count,
                                        selfcal_error* error);

// Sets the version of the calibration with which the states from the next
// keyframe on are estimated. The current segment ends before that keyframe, as
// if it had all its keyframes, however few (but at least 2).
int32_t selfcal_builder_set_calibration_version(selfcal_builder* builder,
                                                int64_t version,
                                                selfcal_error* error);

// Sets the calibration with which the SLAM system estimates the states from the
// next keyframe on: that of its version (selfcal_watch_newest), or its own, if
// it calibrates itself (selfcal_calibration_create). May be called for every
// keyframe; a segment uses that of its last one. With it, tracks are
// triangulated, states are moved with corrected readings, and observations
// outside the image are dropped. It does not set the version.
int32_t selfcal_builder_set_theta(selfcal_builder* builder,
                                  const selfcal_calibration* calibration,
                                  selfcal_error* error);

// States whether the SLAM system is to be trusted, as it is at first. 0 drops
// the current segment and refuses keyframes until it is not 0 again; then a new
// segment begins, with new landmarks. Complete segments remain.
int32_t selfcal_builder_set_healthy(selfcal_builder* builder,
                                    int32_t healthy,
                                    selfcal_error* error);

// Sets the temperature of the device [degrees Celsius] from now on. A segment
// carries the temperature that was set last when it was completed.
// SELFCAL_OUT_OF_RANGE: it is not from -100 to 200, and is ignored.
int32_t selfcal_builder_set_temperature(selfcal_builder* builder,
                                        double celsius,
                                        selfcal_error* error);
// The temperature is unknown from now on, as it is at first.
int32_t selfcal_builder_clear_temperature(selfcal_builder* builder,
                                          selfcal_error* error);

// Ends the current segment, at the end of a session or where tracking was lost.
// It is complete if the IMU samples cover at least max(2, min_keyframes) of its
// keyframes, otherwise it is dropped. The builder continues with the next
// segment of the same session.
int32_t selfcal_builder_flush(selfcal_builder* builder,
                              int32_t min_keyframes,
                              selfcal_error* error);

// Returns the oldest complete segment, or NULL if there is none (or no memory
// for it). Pass it to selfcal_stream_send or selfcal_segment_destroy.
selfcal_segment* selfcal_builder_take(selfcal_builder* builder);

// Index of the next segment; 0 for NULL.
int64_t selfcal_builder_next_index(const selfcal_builder* builder);
// Fills *statistics, whose struct_size is set by the caller.
int32_t selfcal_builder_get_statistics(const selfcal_builder* builder,
                                       selfcal_builder_statistics* statistics,
                                       selfcal_error* error);

// Index of the segment within its session; 0 for NULL.
int64_t selfcal_segment_index(const selfcal_segment* segment);
// Only for a segment that is not sent. NULL is ignored.
void selfcal_segment_destroy(selfcal_segment* segment);

// -------------------------------------------------------------------- Stream

// Sends segments to the daemon, in order and at least once. Its threads encode,
// write to the spool, connect, reconnect with backoff, and resend what was not
// acknowledged.
typedef struct selfcal_stream selfcal_stream;

// Options of a stream and of a watch; a watch ignores those of the queue and of
// the spool.
typedef struct selfcal_client_options {
  uint32_t struct_size;
  // Segments in memory, waiting or unacknowledged; default 16. At least 2 with
  // a spool.
  int32_t max_queue;
  // Segments that are sent before the first of them is acknowledged; default 4.
  int32_t max_unacknowledged;
  uint32_t reserved;
  // Address of the daemon, in the syntax of gRPC; default
  // "unix:/run/selfcal/selfcald.sock".
  const char* target;
  const char* rig;         // without "rigs/"; required
  int64_t min_backoff_ms;  // default 100
  int64_t max_backoff_ms;  // default 5000
  // PEM files for a TCP target with mutual TLS, read at every connection. If
  // all are NULL, TLS is not used. If only ca_file is given, the daemon is
  // authenticated by its certificate, and the client is not authenticated.
  const char* ca_file;  // authorities that may sign the daemon's certificate
  const char* certificate_file;  // the client's, with its chain
  const char* key_file;
  // Folder for segments that do not fit into memory; they go into a subfolder
  // named after the rig, which one stream at a time may use. If NULL, such
  // segments are dropped.
  const char* spool_dir;
  uint64_t max_spool_bytes;  // default 256 MiB
} selfcal_client_options;

typedef struct selfcal_violation {
  const char* field;    // path, e.g. "keyframes[3].q_GI"
  const char* message;  // e.g. "norm is 0.93; send a unit quaternion"
} selfcal_violation;

enum selfcal_verdict {
  SELFCAL_STORED = 0,     // committed and synced by the daemon
  SELFCAL_DUPLICATE = 1,  // the daemon had it already
  SELFCAL_REJECTED = 2    // for the reasons in `violations`
};

// The daemon's verdict on one segment. The library sets struct_size to its own
// size of the struct.
typedef struct selfcal_acknowledgement {
  uint32_t struct_size;
  int32_t verdict;  // a selfcal_verdict
  const char* session;
  int64_t index;
  const selfcal_violation* violations;  // the reasons for a rejection
  uint64_t violation_count;
  // Observations outside the image that the daemon has left out of a segment
  // that it stored.
  uint64_t observations_dropped;
  // Readings of the IMU beyond its full scale, left out likewise.
  uint64_t readings_dropped;
} selfcal_acknowledgement;

typedef void (*selfcal_ack_callback)(const selfcal_acknowledgement* ack,
                                     void* user);

// Counts of segments unless stated otherwise.
typedef struct selfcal_stream_statistics {
  uint32_t struct_size;
  uint32_t reserved;
  uint64_t queued;  // accepted by selfcal_stream_send
  uint64_t stored;
  uint64_t duplicates;
  uint64_t rejected;
  uint64_t dropped;            // refused, or out of memory
  uint64_t resent;             // sent again after a reconnection
  uint64_t connections;        // connections that the daemon answered
  uint64_t callback_failures;  // callbacks that failed
  // Landmarks that are seen often enough and came without a position.
  uint64_t tracks_triangulated;
  // Left out: too little parallax, not consistent, or no calibration is known.
  uint64_t tracks_dropped;
  // Observations that the daemon has left out (selfcal_acknowledgement).
  uint64_t observations_dropped;
  uint64_t spooled;          // written to the spool
  uint64_t spool_recovered;  // found in the spool at the start
  // Quarantined in the spool, because the file differs from what was written.
  uint64_t spool_damaged;
  uint64_t spool_failures;  // disk errors
  // Present content of the spool.
  uint64_t spool_segments;
  uint64_t spool_bytes;
  // Readings of the IMU that the daemon has left out (selfcal_acknowledgement).
  uint64_t readings_dropped;
} selfcal_stream_statistics;

// Creates a stream. It connects when there is something to send, which includes
// segments that an earlier process left in the spool; that the daemon cannot be
// reached is no error. `on_ack` may be NULL; `user` is passed to it.
int32_t selfcal_stream_create(const selfcal_client_options* options,
                              selfcal_ack_callback on_ack,
                              void* user,
                              selfcal_stream** stream,
                              selfcal_error* error);
// Waits for a callback that is running. Writes unacknowledged segments to the
// spool; without a spool, or if it is full, they are lost: call
// selfcal_stream_drain first. NULL is ignored.
void selfcal_stream_destroy(selfcal_stream* stream);

// Queues a segment and takes it over, also if this fails; segments are sent in
// the order of these calls. Returns at once.
// SELFCAL_RESOURCE_EXHAUSTED: memory and spool are full, or the stream has
// ended; the segment is dropped and counted. Older segments stay in the queue.
int32_t selfcal_stream_send(selfcal_stream* stream,
                            selfcal_segment* segment,
                            selfcal_error* error);

// Waits until all segments in the queue and in the spool are acknowledged and
// their callbacks have returned, at most `timeout_ms`. The only function that
// waits; must not be called from a callback.
// SELFCAL_DEADLINE_EXCEEDED: some are not acknowledged yet.
// SELFCAL_NOT_FOUND (the rig does not exist), SELFCAL_INVALID_ARGUMENT,
// SELFCAL_PERMISSION_DENIED, SELFCAL_UNAUTHENTICATED: the daemon has ended the
// stream permanently. After any other error the stream reconnects.
int32_t selfcal_stream_drain(selfcal_stream* stream,
                             int64_t timeout_ms,
                             selfcal_error* error);

// Fills *statistics, whose struct_size is set by the caller.
int32_t selfcal_stream_get_statistics(const selfcal_stream* stream,
                                      selfcal_stream_statistics* statistics,
                                      selfcal_error* error);
// SELFCAL_OK, or the last error while the connection is down.
int32_t selfcal_stream_connection_status(const selfcal_stream* stream,
                                         selfcal_error* error);
// SELFCAL_OK, or the error of the last attempt to use the spool.
int32_t selfcal_stream_spool_status(const selfcal_stream* stream,
                                    selfcal_error* error);

// --------------------------------------------------------------- Calibration

// The gyroscope reads T_g w + T_s f + b_g, the accelerometer T_a R_AI f + b_a,
// where R_AI is the rotation of q_AI. T_g and T_a are upper triangular, with
// the scales on the diagonal and the misalignments (x, y, z) at (0,1), (0,2),
// (1,2). f is the specific force at the accelerometer, of which each axis may
// have a position r of its own: f_I + w x (w x r) + dw/dt x r.
typedef struct selfcal_imu {
  uint32_t struct_size;
  uint32_t reserved;
  double gyro_scale[3];
  double gyro_misalignment[3];
  double accel_scale[3];
  double accel_misalignment[3];
  selfcal_quaternion q_AI;          // rotates from I to A
  int32_t gyro_g_sensitivity_size;  // 9, or 0: zero
  int32_t accel_position_size;      // 3: of all axes, 9: of x, y, z, or 0: zero
  double gyro_g_sensitivity[9];     // T_s, row by row [rad/s per m/s^2]
  double accel_position[9];         // in I [m]
} selfcal_imu;

// Most coefficients that a distortion model has.
#define SELFCAL_MAX_DISTORTION 8

typedef struct selfcal_camera {
  uint32_t struct_size;
  int32_t width_px;
  int32_t height_px;
  int32_t distortion_size;  // coefficients of the model
  // "fov", "double-sphere": docs/concepts.md lists the models with the order of
  // their coefficients. Valid while the library is loaded.
  const char* model;
  double distortion[SELFCAL_MAX_DISTORTION];  // the first distortion_size
  double f[2];                                // focal lengths x, y [px]
  double c[2];                                // principal point x, y [px]
  // T_CI: takes a point from the body frame I to the camera frame C,
  // p_C = R_CI p_I + p_CI, where R_CI is the rotation of q_CI.
  selfcal_quaternion q_CI;
  double p_CI[3];  // [m]
  // t_imu = t_camera + time_offset_s: an image with the timestamp t was exposed
  // at t + time_offset_s on the clock of the IMU.
  double time_offset_s;
  // Nonzero: row v of an image was exposed at t + time_offset_s + v
  // line_delay_s; zero: all rows at once.
  int32_t rolling_shutter;
  uint32_t reserved;
  double line_delay_s;
  // Drift of the clock [s/s]: time_offset_s is the offset where a session
  // begins, and grows by this each second.
  int32_t clock_drifts;  // zero: it does not, and time_drift is not used
  uint32_t reserved2;
  double time_drift;
} selfcal_camera;

// One component of the tangent space of the calibration. The names and units
// are valid as long as the calibration.
typedef struct selfcal_component {
  uint32_t struct_size;
  uint32_t reserved;
  const char* name;  // "imu.gyro.scale.x", "cam0.focal.x", "cam0.p_CI.x"
  const char* unit;  // "-", "rad", "m", "px", "s"
  // The scalar itself; for a rotation the component of its rotation vector.
  double value;
  double sigma;  // its standard deviation; NaN if it is not known
} selfcal_component;

// Creates a calibration from values, with version 0 and without covariance. For
// each camera there is a pointer; `count` is at most 16. Only the first
// distortion_size coefficients are used, and their number must be that of the
// model. SELFCAL_INVALID_ARGUMENT names the value that is not valid.
int32_t selfcal_calibration_create(const selfcal_imu* imu,
                                   const selfcal_camera* const* cameras,
                                   int32_t count,
                                   selfcal_calibration** calibration,
                                   selfcal_error* error);
// The same calibration with other values of one parameter block, with version 0
// and without covariance: for blocks that the structs have no member for.
// docs/concepts.md lists them: "imu.gyro.g_sensitivity", "cam0.focal_slope".
// The values are in the order of the components, of a rotation w, x, y, z; with
// size 0, the calibration has no such block. SELFCAL_INVALID_ARGUMENT: the
// block is not known or has another number of values, or a value is not valid.
int32_t selfcal_calibration_with_block(const selfcal_calibration* calibration,
                                       const char* name,
                                       const double* values,
                                       uint64_t size,
                                       selfcal_calibration** with,
                                       selfcal_error* error);
// A second owner of the same calibration, e.g. to keep what a callback was
// given; NULL for NULL, or if there is no memory.
selfcal_calibration* selfcal_calibration_copy(
    const selfcal_calibration* calibration);
// The calibration at a temperature [degrees Celsius]: without slopes, and with
// the covariance of the values there. One without slopes is the same at every
// temperature. SELFCAL_INVALID_ARGUMENT: it is not the temperature of a device,
// or the values there would be impossible.
int32_t selfcal_calibration_at_temperature(
    const selfcal_calibration* calibration,
    double temperature_c,
    selfcal_calibration** at,
    selfcal_error* error);
// NULL is ignored.
void selfcal_calibration_destroy(selfcal_calibration* calibration);

// Number of the version, from 1 (the factory calibration); 0 for NULL, and for
// a calibration that was made from values.
int64_t selfcal_calibration_version(const selfcal_calibration* calibration);

// The conclusion of the daemon's checks.
enum selfcal_calibration_verdict {
  SELFCAL_VERDICT_UNKNOWN = 0,  // none, or one that this library does not know
  SELFCAL_VERDICT_GOOD = 1,
  SELFCAL_VERDICT_WEAK = 2,  // right, but some directions are hardly known
  // The device has changed since, e.g. by a shock, or a later check contradicts
  // the version: the covariance says nothing about its error.
  SELFCAL_VERDICT_NOT_TRUSTWORTHY = 3,
  SELFCAL_VERDICT_FACTORY = 4  // nothing was estimated
};
// A selfcal_calibration_verdict; SELFCAL_VERDICT_UNKNOWN for NULL, and for a
// calibration that was made from values.
int32_t selfcal_calibration_get_verdict(const selfcal_calibration* calibration);
// Number of reasons for the verdict; 0 for NULL.
int32_t selfcal_calibration_reason_count(
    const selfcal_calibration* calibration);
// One of them, a sentence that is valid as long as the calibration; NULL for
// NULL, and if there is no such reason.
const char* selfcal_calibration_reason(const selfcal_calibration* calibration,
                                       int32_t index);

// 0 for NULL.
int32_t selfcal_calibration_camera_count(
    const selfcal_calibration* calibration);
// D, the dimension of the tangent space; 0 for NULL.
int32_t selfcal_calibration_component_count(
    const selfcal_calibration* calibration);

// The following fill *imu, *camera or *component, whose struct_size is set by
// the caller. The values of a calibration with slopes are those at its
// reference temperature; the slopes are among its components.
// SELFCAL_OUT_OF_RANGE: there is no such camera or component.
int32_t selfcal_calibration_get_imu(const selfcal_calibration* calibration,
                                    selfcal_imu* imu,
                                    selfcal_error* error);
int32_t selfcal_calibration_get_camera(const selfcal_calibration* calibration,
                                       int32_t index,
                                       selfcal_camera* camera,
                                       selfcal_error* error);
int32_t selfcal_calibration_get_component(
    const selfcal_calibration* calibration,
    int32_t index,
    selfcal_component* component,
    selfcal_error* error);

// Fills covariance[0 .. size-1], where size must be D * D, with the covariance
// of the components, in their units, row by row.
// SELFCAL_FAILED_PRECONDITION: it is not known.
int32_t selfcal_calibration_get_covariance(
    const selfcal_calibration* calibration,
    double* covariance,
    uint64_t size,
    selfcal_error* error);

// Corrects a pair of readings: angular rate w_I [rad/s] and specific force f_I
// (acceleration minus gravity) [m/s^2], both in the body frame. b_g [rad/s, in
// I] and b_a [m/s^2, in A] are the biases at that time. With a position of the
// accelerometer, dw/dt is taken as zero.
int32_t selfcal_calibration_correct_imu(const selfcal_calibration* calibration,
                                        const double gyro[3],
                                        const double accel[3],
                                        const double b_g[3],
                                        const double b_a[3],
                                        double w_I[3],
                                        double f_I[3],
                                        selfcal_error* error);
// The same at the angular acceleration dw_I [rad/s^2], e.g. the difference of
// w_I between samples. With the accelerometer 1 cm from the origin, 10 rad/s^2
// matter by 0.1 m/s^2.
int32_t selfcal_calibration_correct_imu_dw(
    const selfcal_calibration* calibration,
    const double gyro[3],
    const double accel[3],
    const double b_g[3],
    const double b_a[3],
    const double dw_I[3],
    double w_I[3],
    double f_I[3],
    selfcal_error* error);
// For a filter that exchanges its calibration while it runs: changes its biases
// b_g [rad/s, in I] and b_a [m/s^2, in A] so that readings at rest give the
// same rate and force under `to` as under `from`. f_I is the specific force at
// rest: (0, 0, g), rotated from G to I. Biases absorb what is wrong in a
// calibration: with those of `from`, a filter would have to estimate them
// again.
int32_t selfcal_calibration_carry_biases(const selfcal_calibration* from,
                                         const selfcal_calibration* to,
                                         const double f_I[3],
                                         double b_g[3],
                                         double b_a[3],
                                         selfcal_error* error);
// Projects a point in the camera frame (any positive scale) to its pixel,
// whether or not that is inside the image. SELFCAL_OUT_OF_RANGE: there is no
// such camera, or the model has no answer: it is not one-to-one at the point (a
// pinhole: also if the point is not in front).
int32_t selfcal_calibration_project(const selfcal_calibration* calibration,
                                    int32_t camera,
                                    const double p_C[3],
                                    double z_px[2],
                                    selfcal_error* error);
// Computes the unit bearing in the camera frame of a pixel.
// SELFCAL_OUT_OF_RANGE: there is no such camera, or no point projects there.
int32_t selfcal_calibration_unproject(const selfcal_calibration* calibration,
                                      int32_t camera,
                                      const double z_px[2],
                                      double bearing_C[3],
                                      selfcal_error* error);

// --------------------------------------------------------------------- Watch

// Watches the active calibration of a rig. Reconnects when the daemon restarts,
// and waits for a rig that does not exist yet.
typedef struct selfcal_watch selfcal_watch;

typedef void (*selfcal_calibration_callback)(
    const selfcal_calibration* calibration, void* user);

// Creates a watch, which calls back with the active version as soon as the
// daemon answers, with each version that becomes active later, and again with
// the active one when its verdict changes. A slow callback gets the newest
// version; none is delivered twice in a row with the same verdict.
// `on_new` may be NULL, for selfcal_watch_newest; `user` is passed to it.
int32_t selfcal_watch_create(const selfcal_client_options* options,
                             selfcal_calibration_callback on_new,
                             void* user,
                             selfcal_watch** watch,
                             selfcal_error* error);
// Waits for a callback that is running. NULL is ignored.
void selfcal_watch_destroy(selfcal_watch* watch);

// The newest version that the daemon has sent, to be destroyed by the caller;
// NULL if there is none yet, for NULL, or if there is no memory.
selfcal_calibration* selfcal_watch_newest(const selfcal_watch* watch);
// SELFCAL_OK, or the last error of the connection while it is down.
int32_t selfcal_watch_connection_status(const selfcal_watch* watch,
                                        selfcal_error* error);

#ifdef __cplusplus
}  // extern "C"
#endif
