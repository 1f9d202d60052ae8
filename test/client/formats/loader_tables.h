// The keys that the loader of each tool reads, from the sources that
// docs/formats.md names.
#pragma once

#include <limits>

namespace selfcal::client {

enum class Type {
  kText,     // not a number, unless it is in quotes
  kInteger,  // without a decimal point
  kReal,     // with a decimal point
  kNumber,   // either
  kMap,      // its keys are those that follow a dot
  kList,     // of maps
  // Of `rows` x `cols` entries:
  kIntegers,
  kReals,
  kNumbers,
  kRows,          // list of lists
  kOpenCvMatrix,  // !!opencv-matrix of one list
  kMapMatrix      // a map of rows, cols, data
};

enum class Use {
  kRequired,
  kOptional,
  kUnread,   // written for readers of the file: the loader skips it
  kSetting,  // required, but not part of a calibration: the user adds it
};

struct Range {
  double least = -std::numeric_limits<double>::infinity();
  double most = std::numeric_limits<double>::infinity();
};
inline constexpr Range kAbove0 = {.least = std::numeric_limits<double>::min()};
inline constexpr Range kFrom0 = {.least = 0};

struct Key {
  const char* path;
  Type type;
  Use use = Use::kRequired;
  int rows = 1;
  int cols = 1;
  Range range = {};
};

constexpr Key Above0(const char* path, Type type = Type::kNumber) {
  return {path, type, Use::kRequired, 1, 1, kAbove0};
}

// kalibr_common/ConfigReader.py: CameraParameters and CameraChainParameters.
// Python's isinstance separates numbers with and without a decimal point. Each
// key of the first level is counted as a camera.
inline constexpr Key kKalibrCamera[] = {
    {"rostopic", Type::kText},
    {"camera_model", Type::kText},
    {"distortion_model", Type::kText},
    {"resolution", Type::kIntegers, Use::kRequired, 2, 1, kAbove0},
    {"T_cam_imu", Type::kRows, Use::kOptional, 4, 4},
    {"timeshift_cam_imu", Type::kReal, Use::kOptional}};
inline constexpr Key kKalibrPinhole[] = {
    {"intrinsics", Type::kReals, Use::kRequired, 4, 1, kFrom0}};
inline constexpr Key kKalibrOmni[] = {
    {"intrinsics", Type::kReals, Use::kRequired, 5, 1, kFrom0}};
inline constexpr Key kKalibrEucm[] = {
    {"intrinsics", Type::kReals, Use::kRequired, 6, 1, kFrom0}};
inline constexpr Key kKalibrDs[] = {  // xi may be negative
    {"intrinsics", Type::kReals, Use::kRequired, 6}};
inline constexpr Key kKalibrFourCoefficients[] = {
    {"distortion_coeffs", Type::kReals, Use::kRequired, 4}};
inline constexpr Key kKalibrFov[] = {
    {"distortion_coeffs", Type::kReals, Use::kRequired, 1}};
inline constexpr Key kKalibrNone[] = {
    {"distortion_coeffs", Type::kReals, Use::kRequired, 0}};
inline constexpr Key kKalibrNextCamera[] = {
    {"T_cn_cnm1", Type::kRows, Use::kRequired, 4, 4}};
// ImuParameters, which --imu reads. IccSensors.py writes the others, and starts
// from the identity.
inline constexpr Key kKalibrImu[] = {
    {"rostopic", Type::kText},
    Above0("update_rate"),
    Above0("accelerometer_noise_density", Type::kReal),
    Above0("accelerometer_random_walk", Type::kReal),
    Above0("gyroscope_noise_density", Type::kReal),
    Above0("gyroscope_random_walk", Type::kReal),
    {"model", Type::kText, Use::kUnread},
    {"time_offset", Type::kReal, Use::kUnread},
    {"accelerometers", Type::kMap, Use::kUnread},
    {"accelerometers.M", Type::kRows, Use::kUnread, 3, 3},
    {"accelerometers.rx_i", Type::kReals, Use::kUnread, 3},
    {"accelerometers.ry_i", Type::kReals, Use::kUnread, 3},
    {"accelerometers.rz_i", Type::kReals, Use::kUnread, 3},
    {"gyroscopes", Type::kMap, Use::kUnread},
    {"gyroscopes.M", Type::kRows, Use::kUnread, 3, 3},
    {"gyroscopes.A", Type::kRows, Use::kUnread, 3, 3},
    {"gyroscopes.C_gyro_i", Type::kRows, Use::kUnread, 3, 3}};
inline constexpr Key kKalibrSecondImu[] = {
    {"T_i_b", Type::kRows, Use::kUnread, 4, 4}};

// VioManagerOptions.h, StateOptions.h and ROS1Visualizer.cpp.
inline constexpr Key kOpenVinsCamera[] = {
    {"T_imu_cam", Type::kRows, Use::kRequired, 4, 4},
    {"distortion_model", Type::kText},
    {"distortion_coeffs", Type::kNumbers, Use::kRequired, 4},
    {"intrinsics", Type::kNumbers, Use::kRequired, 4},
    {"resolution", Type::kIntegers, Use::kRequired, 2, 1, kAbove0},
    {"timeshift_cam_imu", Type::kNumber, Use::kOptional},
    {"rostopic", Type::kText},
    {"camera_model", Type::kText, Use::kUnread}};
inline constexpr Key kOpenVinsImu[] = {
    {"imu0", Type::kMap},
    {"imu0.gyroscope_noise_density", Type::kNumber},
    {"imu0.gyroscope_random_walk", Type::kNumber},
    {"imu0.accelerometer_noise_density", Type::kNumber},
    {"imu0.accelerometer_random_walk", Type::kNumber},
    {"imu0.model", Type::kText},
    {"imu0.Tw", Type::kRows, Use::kRequired, 3, 3},
    {"imu0.Ta", Type::kRows, Use::kRequired, 3, 3},
    {"imu0.R_IMUtoACC", Type::kRows, Use::kRequired, 3, 3},
    {"imu0.R_IMUtoGYRO", Type::kRows, Use::kRequired, 3, 3},
    {"imu0.Tg", Type::kRows, Use::kRequired, 3, 3},
    {"imu0.rostopic", Type::kText},
    {"imu0.T_i_b", Type::kRows, Use::kUnread, 4, 4},
    {"imu0.update_rate", Type::kNumber, Use::kUnread},
    {"imu0.time_offset", Type::kNumber, Use::kUnread}};

// Settings.cc. It aborts at a number where it expects an integer, and the
// reverse for text.
inline constexpr Key kOrbSlam3[] = {
    {"File.version", Type::kText},
    {"Camera.type", Type::kText},
    {"Camera.width", Type::kInteger},
    {"Camera.height", Type::kInteger},
    {"Camera1.fx", Type::kNumber},
    {"Camera1.fy", Type::kNumber},
    {"Camera1.cx", Type::kNumber},
    {"Camera1.cy", Type::kNumber},
    {"IMU.T_b_c1", Type::kOpenCvMatrix, Use::kRequired, 4, 4},
    {"IMU.NoiseGyro", Type::kNumber},
    {"IMU.NoiseAcc", Type::kNumber},
    {"IMU.GyroWalk", Type::kNumber},
    {"IMU.AccWalk", Type::kNumber},
    {"IMU.Frequency", Type::kNumber},
    {"Camera.fps", Type::kInteger, Use::kSetting},
    {"Camera.RGB", Type::kInteger, Use::kSetting},
    {"ORBextractor.nFeatures", Type::kInteger, Use::kSetting},
    {"ORBextractor.scaleFactor", Type::kNumber, Use::kSetting},
    {"ORBextractor.nLevels", Type::kInteger, Use::kSetting},
    {"ORBextractor.iniThFAST", Type::kInteger, Use::kSetting},
    {"ORBextractor.minThFAST", Type::kInteger, Use::kSetting}};
inline constexpr Key kOrbSlam3Pinhole[] = {
    {"Camera1.k1", Type::kNumber},
    {"Camera1.k2", Type::kNumber},
    {"Camera1.p1", Type::kNumber},
    {"Camera1.p2", Type::kNumber},
    {"Camera1.k3", Type::kNumber, Use::kOptional}};
inline constexpr Key kOrbSlam3Fisheye[] = {
    {"Camera1.k1", Type::kNumber},
    {"Camera1.k2", Type::kNumber},
    {"Camera1.k3", Type::kNumber},
    {"Camera1.k4", Type::kNumber},
    {"Camera1.overlappingBegin", Type::kInteger},
    {"Camera1.overlappingEnd", Type::kInteger}};
inline constexpr Key kOrbSlam3Stereo[] = {
    {"Camera2.fx", Type::kNumber},
    {"Camera2.fy", Type::kNumber},
    {"Camera2.cx", Type::kNumber},
    {"Camera2.cy", Type::kNumber},
    {"Stereo.T_c1_c2", Type::kOpenCvMatrix, Use::kRequired, 4, 4},
    {"Stereo.ThDepth", Type::kNumber, Use::kSetting}};
inline constexpr Key kOrbSlam3StereoPinhole[] = {
    {"Camera2.k1", Type::kNumber},
    {"Camera2.k2", Type::kNumber},
    {"Camera2.p1", Type::kNumber},
    {"Camera2.p2", Type::kNumber},
    {"Camera2.k3", Type::kNumber, Use::kOptional}};
// Some versions read the coefficients of the second camera from the first.
inline constexpr Key kOrbSlam3StereoFisheye[] = {
    {"Camera2.k1", Type::kNumber},
    {"Camera2.k2", Type::kNumber},
    {"Camera2.k3", Type::kNumber},
    {"Camera2.k4", Type::kNumber},
    {"Camera2.overlappingBegin", Type::kInteger},
    {"Camera2.overlappingEnd", Type::kInteger}};

// parameters.cpp.
inline constexpr Key kVinsFusion[] = {
    {"imu", Type::kInteger},
    {"num_of_cam", Type::kInteger},
    {"image_width", Type::kInteger},
    {"image_height", Type::kInteger},
    {"acc_n", Type::kNumber},
    {"acc_w", Type::kNumber},
    {"gyr_n", Type::kNumber},
    {"gyr_w", Type::kNumber},
    {"g_norm", Type::kNumber},
    {"td", Type::kNumber},
    {"cam0_calib", Type::kText},
    {"body_T_cam0", Type::kOpenCvMatrix, Use::kRequired, 4, 4},
    {"image0_topic", Type::kText, Use::kSetting},
    {"imu_topic", Type::kText, Use::kSetting},
    {"max_cnt", Type::kInteger, Use::kSetting},
    {"min_dist", Type::kInteger, Use::kSetting},
    {"F_threshold", Type::kNumber, Use::kSetting},
    {"show_track", Type::kInteger, Use::kSetting},
    {"flow_back", Type::kInteger, Use::kSetting},
    {"multiple_thread", Type::kInteger, Use::kSetting},
    {"max_solver_time", Type::kNumber, Use::kSetting},
    {"max_num_iterations", Type::kInteger, Use::kSetting},
    {"keyframe_parallax", Type::kNumber, Use::kSetting},
    {"output_path", Type::kText, Use::kSetting},
    {"estimate_extrinsic", Type::kInteger, Use::kSetting},
    {"estimate_td", Type::kInteger, Use::kSetting}};
inline constexpr Key kVinsFusionStereo[] = {
    {"cam1_calib", Type::kText},
    {"body_T_cam1", Type::kOpenCvMatrix, Use::kRequired, 4, 4},
    {"image1_topic", Type::kText, Use::kSetting}};
// camodocal's PinholeCamera.cc, PinholeFullCamera.cc, CataCamera.cc and
// EquidistantCamera.cc.
inline constexpr Key kVinsFusionCamera[] = {
    {"model_type", Type::kText},
    {"camera_name", Type::kText},
    {"image_width", Type::kInteger},
    {"image_height", Type::kInteger},
    {"projection_parameters", Type::kMap}};
inline constexpr Key kVinsFusionPinhole[] = {
    {"distortion_parameters", Type::kMap},
    {"distortion_parameters.k1", Type::kNumber},
    {"distortion_parameters.k2", Type::kNumber},
    {"distortion_parameters.p1", Type::kNumber},
    {"distortion_parameters.p2", Type::kNumber},
    {"projection_parameters.fx", Type::kNumber},
    {"projection_parameters.fy", Type::kNumber},
    {"projection_parameters.cx", Type::kNumber},
    {"projection_parameters.cy", Type::kNumber}};
inline constexpr Key kVinsFusionFull[] = {
    {"distortion_parameters.k3", Type::kNumber},
    {"distortion_parameters.k4", Type::kNumber},
    {"distortion_parameters.k5", Type::kNumber},
    {"distortion_parameters.k6", Type::kNumber}};
inline constexpr Key kVinsFusionMei[] = {
    {"mirror_parameters", Type::kMap},
    {"mirror_parameters.xi", Type::kNumber},
    {"distortion_parameters", Type::kMap},
    {"distortion_parameters.k1", Type::kNumber},
    {"distortion_parameters.k2", Type::kNumber},
    {"distortion_parameters.p1", Type::kNumber},
    {"distortion_parameters.p2", Type::kNumber},
    {"projection_parameters.gamma1", Type::kNumber},
    {"projection_parameters.gamma2", Type::kNumber},
    {"projection_parameters.u0", Type::kNumber},
    {"projection_parameters.v0", Type::kNumber}};
inline constexpr Key kVinsFusionFisheye[] = {
    {"projection_parameters.k2", Type::kNumber},
    {"projection_parameters.k3", Type::kNumber},
    {"projection_parameters.k4", Type::kNumber},
    {"projection_parameters.k5", Type::kNumber},
    {"projection_parameters.mu", Type::kNumber},
    {"projection_parameters.mv", Type::kNumber},
    {"projection_parameters.u0", Type::kNumber},
    {"projection_parameters.v0", Type::kNumber}};

// headers_serialization.h and eigen_io.h; cereal's JSON archive requires every
// key, and whole numbers where it reads integers.
inline constexpr Key kBasalt[] = {
    {"T_imu_cam", Type::kList},
    {"intrinsics", Type::kList},
    {"resolution", Type::kList},
    {"calib_accel_bias", Type::kNumbers, Use::kRequired, 9},
    {"calib_gyro_bias", Type::kNumbers, Use::kRequired, 12},
    {"imu_update_rate", Type::kNumber},
    {"accel_noise_std", Type::kNumbers, Use::kRequired, 3},
    {"gyro_noise_std", Type::kNumbers, Use::kRequired, 3},
    {"accel_bias_std", Type::kNumbers, Use::kRequired, 3},
    {"gyro_bias_std", Type::kNumbers, Use::kRequired, 3},
    {"cam_time_offset_ns", Type::kInteger},
    {"vignette", Type::kList}};
inline constexpr Key kBasaltPose[] = {{"px", Type::kNumber},
                                      {"py", Type::kNumber},
                                      {"pz", Type::kNumber},
                                      {"qx", Type::kNumber},
                                      {"qy", Type::kNumber},
                                      {"qz", Type::kNumber},
                                      {"qw", Type::kNumber}};
inline constexpr Key kBasaltCamera[] = {{"camera_type", Type::kText},
                                        {"intrinsics", Type::kMap},
                                        {"intrinsics.fx", Type::kNumber},
                                        {"intrinsics.fy", Type::kNumber},
                                        {"intrinsics.cx", Type::kNumber},
                                        {"intrinsics.cy", Type::kNumber}};
inline constexpr Key kBasaltKb4[] = {{"intrinsics.k1", Type::kNumber},
                                     {"intrinsics.k2", Type::kNumber},
                                     {"intrinsics.k3", Type::kNumber},
                                     {"intrinsics.k4", Type::kNumber}};
inline constexpr Key kBasaltEucm[] = {{"intrinsics.alpha", Type::kNumber},
                                      {"intrinsics.beta", Type::kNumber}};
inline constexpr Key kBasaltDs[] = {{"intrinsics.xi", Type::kNumber},
                                    {"intrinsics.alpha", Type::kNumber}};
inline constexpr Key kBasaltRadTan8[] = {{"intrinsics.p1", Type::kNumber},
                                         {"intrinsics.p2", Type::kNumber},
                                         {"intrinsics.k5", Type::kNumber},
                                         {"intrinsics.k6", Type::kNumber},
                                         {"intrinsics.rpmax", Type::kNumber}};

// sensor-manager.cc, sensor.cc, imu.cc, ncamera.cc, camera.cc,
// camera-pinhole.cc, camera-unified-projection.cc and distortion-fisheye.cc.
inline constexpr Key kMaplabImu[] = {
    {"id", Type::kText, Use::kOptional},
    {"topic", Type::kText, Use::kOptional},
    {"description", Type::kText, Use::kOptional},
    {"sensor_type", Type::kText},
    {"sigmas", Type::kMap},
    Above0("sigmas.gyro_noise_density"),
    Above0("sigmas.gyro_bias_random_walk_noise_density"),
    Above0("sigmas.acc_noise_density"),
    Above0("sigmas.acc_bias_random_walk_noise_density"),
    {"saturation_accel_max_mps2", Type::kNumber, Use::kRequired, 1, 1, kFrom0},
    {"saturation_gyro_max_radps", Type::kNumber, Use::kRequired, 1, 1, kFrom0},
    {"gravity_magnitude_mps2",
     Type::kNumber,
     Use::kRequired,
     1,
     1,
     {.least = 9, .most = 10}}};
inline constexpr Key kMaplabCameras[] = {
    {"id", Type::kText, Use::kOptional},
    {"topic", Type::kText, Use::kOptional},
    {"description", Type::kText, Use::kOptional},
    {"sensor_type", Type::kText},
    {"cameras", Type::kList}};
inline constexpr Key kMaplabCamera[] = {
    {"camera", Type::kMap},
    {"camera.id", Type::kText, Use::kOptional},
    {"camera.topic", Type::kText, Use::kOptional},
    {"camera.description", Type::kText, Use::kOptional},
    {"camera.sensor_type", Type::kText, Use::kUnread},
    {"camera.type", Type::kText},
    {"camera.line-delay-nanoseconds", Type::kInteger, Use::kOptional},
    {"camera.image_width", Type::kInteger},
    {"camera.image_height", Type::kInteger},
    {"camera.distortion", Type::kMap, Use::kOptional},
    {"camera.distortion.type", Type::kText},
    {"T_B_C", Type::kMapMatrix, Use::kRequired, 4, 4}};
inline constexpr Key kMaplabPinhole[] = {
    {"camera.intrinsics", Type::kMapMatrix, Use::kRequired, 4, 1, kAbove0}};
inline constexpr Key kMaplabUnified[] = {
    {"camera.intrinsics", Type::kMapMatrix, Use::kRequired, 5, 1, kFrom0}};
inline constexpr Key kMaplabFourCoefficients[] = {
    {"camera.distortion.parameters", Type::kMapMatrix, Use::kRequired, 4, 1}};
inline constexpr Key kMaplabFisheye[] = {{"camera.distortion.parameters",
                                          Type::kMapMatrix,
                                          Use::kRequired,
                                          1,
                                          1,
                                          {.least = 0.5, .most = 1.5}}};
inline constexpr Key kMaplabExtrinsics[] = {
    {"sensor_id", Type::kText},
    {"base_sensor_id", Type::kText},
    {"T_B_S", Type::kMapMatrix, Use::kRequired, 4, 4}};

// camera_calibration_parsers, parse_yml.cpp (a matrix is a map of rows, cols
// and data, whose size is that of the array of sensor_msgs/CameraInfo), and
// sensor_msgs/distortion_models.h.
inline constexpr Key kCameraInfo[] = {
    Above0("image_width", Type::kInteger),
    Above0("image_height", Type::kInteger),
    {"camera_name", Type::kText, Use::kOptional},
    {"camera_matrix", Type::kMapMatrix, Use::kRequired, 3, 3},
    {"distortion_model", Type::kText, Use::kOptional},
    {"rectification_matrix", Type::kMapMatrix, Use::kRequired, 3, 3},
    {"projection_matrix", Type::kMapMatrix, Use::kRequired, 3, 4}};
inline constexpr Key kCameraInfoPlumbBob[] = {
    {"distortion_coefficients", Type::kMapMatrix, Use::kRequired, 1, 5}};
inline constexpr Key kCameraInfoRational[] = {
    {"distortion_coefficients", Type::kMapMatrix, Use::kRequired, 1, 8}};
inline constexpr Key kCameraInfoEquidistant[] = {
    {"distortion_coefficients", Type::kMapMatrix, Use::kRequired, 1, 4}};

}  // namespace selfcal::client
