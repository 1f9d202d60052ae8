#include "test/rendering/euroc_folder.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <google/protobuf/util/json_util.h>

#include <Eigen/Geometry>
#include <fstream>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <stdexcept>
#include <string>
#include <string_view>

#include "core/model/camera_model.h"
#include "proto/convert.h"

namespace selfcal {
namespace {

namespace fs = std::filesystem;

// PNG's zlib level: 1 is several times as fast as the default, and the noise of
// images does not compress anyway.
constexpr int kPngCompression = 1;

void WriteText(const fs::path& path, const std::string& text) {
  fs::create_directories(path.parent_path());
  std::ofstream file(path, std::ios::binary);
  file << text;
  if (!file.flush()) {
    throw std::runtime_error("cannot write " + path.string());
  }
}

std::string CsvNumbers(const Eigen::Vector3d& v) {
  return fmt::format("{:.17g},{:.17g},{:.17g}", v.x(), v.y(), v.z());
}

// The camera model of the format: a pinhole unless Kalibr, whose conventions it
// shares, calls it otherwise.
std::string_view CameraModelOf(const CameraCalibration& camera) {
  for (const ToolModel& tool : ModelInfo(camera.model).tools) {
    if (tool.tool == "kalibr") return tool.name;
  }
  return "pinhole";
}

// The key T_BS of a sensor S, from its T_SB.
std::string PoseText(const Eigen::Quaterniond& q_SB,
                     const Eigen::Vector3d& p_SB) {
  const Eigen::Matrix3d R_BS = q_SB.conjugate().toRotationMatrix();
  const Eigen::Vector3d p_BS = -(R_BS * p_SB);
  std::string rows;
  for (int i = 0; i < 3; ++i) {
    rows += fmt::format("{:.17g}, {:.17g}, {:.17g}, {:.17g},\n         ",
                        R_BS(i, 0),
                        R_BS(i, 1),
                        R_BS(i, 2),
                        p_BS[i]);
  }
  return fmt::format(
      "T_BS:\n"
      "  cols: 4\n"
      "  rows: 4\n"
      "  data: [{}0.0, 0.0, 0.0, 1.0]\n",
      rows);
}

std::string CameraYaml(const CameraCalibration& camera,
                       const RenderOptions& options) {
  return fmt::format(
      "sensor_type: camera\n"
      "comment: rendered\n"
      "{}"
      "rate_hz: {}\n"
      "resolution: [{}, {}]\n"
      "camera_model: {}\n"
      "intrinsics: [{:.17g}, {:.17g}, {:.17g}, {:.17g}]\n"
      "distortion_model: {}\n"
      "distortion_coefficients: [{:.17g}]\n"
      "time_offset_s: {:.17g}\n"
      "line_delay_s: {:.17g}\n"
      "exposure_s: {:.17g}\n",
      PoseText(camera.q_CI, camera.p_CI),
      options.image_rate_hz,
      camera.width_px,
      camera.height_px,
      CameraModelOf(camera),
      camera.f.x(),
      camera.f.y(),
      camera.c.x(),
      camera.c.y(),
      DistortionName(camera.model),
      fmt::join(camera.distortion.data(),
                camera.distortion.data() + camera.distortion.size(),
                ", "),
      camera.time_offset_s,
      camera.line_delay_s.value_or(0),
      options.exposure_s);
}

constexpr std::string_view kBodyPose =
    "T_BS:\n"
    "  cols: 4\n"
    "  rows: 4\n"
    "  data: [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0,\n"
    "         0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0]\n";

void WriteImu(const ImuNoise& noise,
              double rate_hz,
              const ImuReadings& readings,
              std::string_view pose,
              const fs::path& folder) {
  WriteText(folder / "sensor.yaml",
            fmt::format("sensor_type: imu\n"
                        "comment: simulated\n"
                        "{}"
                        "rate_hz: {}\n"
                        "gyroscope_noise_density: {:.17g}\n"
                        "gyroscope_random_walk: {:.17g}\n"
                        "accelerometer_noise_density: {:.17g}\n"
                        "accelerometer_random_walk: {:.17g}\n",
                        pose,
                        rate_hz,
                        noise.gyro_noise_density,
                        noise.gyro_bias_random_walk,
                        noise.accel_noise_density,
                        noise.accel_bias_random_walk));
  std::string csv =
      "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],"
      "w_RS_S_z [rad s^-1],a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],"
      "a_RS_S_z [m s^-2]\n";
  for (const ImuSample& sample : readings.measured) {
    csv += fmt::format("{},{},{}\n",
                       kEurocEpoch_ns + sample.t_ns,
                       CsvNumbers(sample.gyro),
                       CsvNumbers(sample.accel));
  }
  WriteText(folder / "data.csv", csv);
}

void WriteStates(const RenderedRecording& recording, const fs::path& folder) {
  WriteText(folder / "sensor.yaml",
            fmt::format("sensor_type: visual-inertial\n"
                        "comment: the simulated truth\n"
                        "{}",
                        kBodyPose));
  std::string csv =
      "#timestamp,p_RS_R_x [m],p_RS_R_y [m],p_RS_R_z [m],q_RS_w [],"
      "q_RS_x [],q_RS_y [],q_RS_z [],v_RS_R_x [m s^-1],v_RS_R_y [m s^-1],"
      "v_RS_R_z [m s^-1],b_w_RS_S_x [rad s^-1],b_w_RS_S_y [rad s^-1],"
      "b_w_RS_S_z [rad s^-1],b_a_RS_S_x [m s^-2],b_a_RS_S_y [m s^-2],"
      "b_a_RS_S_z [m s^-2]\n";
  for (const ImuSample& sample : recording.imu().measured) {
    const KeyframeState x =
        TrueState(recording.trajectory(), recording.imu(), sample.t_ns);
    csv += fmt::format("{},{},{:.17g},{},{},{},{}\n",
                       kEurocEpoch_ns + sample.t_ns,
                       CsvNumbers(x.p_GI),
                       x.q_GI.w(),
                       CsvNumbers(x.q_GI.vec()),
                       CsvNumbers(x.v_GI),
                       CsvNumbers(x.b_g),
                       CsvNumbers(x.b_a));
  }
  WriteText(folder / "data.csv", csv);
}

void WriteTruth(const Calibration& theta, const fs::path& path) {
  google::protobuf::util::JsonPrintOptions options;
  options.add_whitespace = true;
  options.preserve_proto_field_names = true;
  std::string json;
  const auto status = google::protobuf::util::MessageToJsonString(
      ToProto(theta), &json, options);
  if (!status.ok()) throw std::runtime_error(status.ToString());
  WriteText(path, json);
}

void WriteImage(const GreyImage& image, const fs::path& path) {
  const cv::Mat pixels(image.height_px,
                       image.width_px,
                       CV_8UC1,
                       const_cast<std::uint8_t*>(image.pixels.data()));
  if (!cv::imwrite(
          path, pixels, {cv::IMWRITE_PNG_COMPRESSION, kPngCompression})) {
    throw std::runtime_error("cannot write " + path.string());
  }
}

}  // namespace

void WriteEurocFolder(const RenderedRecording& recording,
                      const Calibration& stated,
                      const fs::path& folder,
                      const std::function<void(int)>& written) {
  const fs::path mav = folder / "mav0";
  WriteTruth(recording.rig().factory, folder / "calibration.json");
  const double rate_hz = recording.options().imu_rate_hz;
  WriteImu(recording.rig().imu_noise,
           rate_hz,
           recording.imu(),
           kBodyPose,
           mav / "imu0");
  if (recording.imu1()) {
    WriteImu(recording.rig().imu1_noise,
             rate_hz,
             *recording.imu1(),
             PoseText(stated.imu1->q_JI, stated.imu1->p_JI),
             mav / "imu1");
  }
  WriteStates(recording, mav / "state_groundtruth_estimate0");
  int images = 0;
  for (int j = 0; j < recording.cameras(); ++j) {
    const fs::path camera = mav / fmt::format("cam{}", j);
    fs::create_directories(camera / "data");
    WriteText(camera / "sensor.yaml",
              CameraYaml(stated.cameras[static_cast<std::size_t>(j)],
                         recording.options()));
    std::string csv = "#timestamp [ns],filename\n";
    for (int k = 0; k < recording.images(); ++k) {
      const std::int64_t stamp_ns = kEurocEpoch_ns + recording.stamp_ns(k);
      const std::string name = fmt::format("{}.png", stamp_ns);
      csv += fmt::format("{},{}\n", stamp_ns, name);
      WriteImage(recording.Image(j, k), camera / "data" / name);
      if (written) written(++images);
    }
    WriteText(camera / "data.csv", csv);
  }
}

}  // namespace selfcal
