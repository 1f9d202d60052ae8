#include "client/import/vi_map.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <zlib.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "core/factor/inertial.h"
#include "core/factor/reprojection.h"
#include "core/model/so3.h"
#include "selfcal/vi_map/vi_map.pb.h"
#include "test/recordings.h"
#include "test/support/temp_folder.h"

namespace selfcal::client {
namespace {

using ::testing::HasSubstr;
namespace fs = std::filesystem;

double Median(std::vector<double> values) {
  std::nth_element(
      values.begin(), values.begin() + values.size() / 2, values.end());
  return values[values.size() / 2];
}

std::vector<double> ReprojectionErrors(const ViMapRecording& recording) {
  std::vector<double> errors;
  for (const ViMapKeyframe& keyframe : recording.keyframes) {
    for (const KeyframeObservation& o : keyframe.observations) {
      Eigen::Vector2d residual;
      if (Reproject(keyframe.state.q_GI,
                    keyframe.state.p_GI,
                    recording.rig.factory.cameras[o.camera],
                    o.p_G.homogeneous(),
                    o.z_px,
                    &residual,
                    nullptr)) {
        errors.push_back(residual.norm());
      }
    }
  }
  return errors;
}

// A copy of the recording that a test may damage.
class DamagedMap : public ::testing::Test {
 protected:
  void SetUp() override {
    SELFCAL_NEED_RECORDING(source, "equidistant_room");
    fs::copy(source, folder_, fs::copy_options::recursive);
    fs::permissions(
        folder_ / "vi_map", fs::perms::owner_all, fs::perm_options::add);
    for (const auto& file : fs::directory_iterator(folder_ / "vi_map")) {
      fs::permissions(file, fs::perms::owner_write, fs::perm_options::add);
    }
  }

  absl::Status ReadError() { return ReadViMap(folder_.string(), {}).status(); }
  std::string File(const std::string& name) {
    return (folder_ / "vi_map" / name).string();
  }
  // Replaces the part `name` by a message.
  void Write(const std::string& name, const vi_map::ViMap& map) {
    const std::string data = map.SerializeAsString();
    gzFile file = gzopen(File(name).c_str(), "wb");
    ASSERT_EQ(gzwrite(file, data.data(), data.size()),
              static_cast<int>(data.size()));
    gzclose(file);
  }
  vi_map::ViMap Read(const std::string& name) {
    std::string data;
    gzFile file = gzopen(File(name).c_str(), "rb");
    char buffer[4096];
    for (int n; (n = gzread(file, buffer, sizeof buffer)) > 0;) {
      data.append(buffer, n);
    }
    gzclose(file);
    vi_map::ViMap map;
    EXPECT_TRUE(map.ParseFromString(data));
    return map;
  }

  const TempFolder temp_folder_;
  const fs::path folder_ = temp_folder_.path() / "map";
};

TEST(ReadViMap, TangoRecordingHasItsKnownFigures) {
  SELFCAL_NEED_RECORDING(folder, "tango_handheld");
  const auto recording = ReadViMap(folder, {});
  ASSERT_TRUE(recording.ok()) << recording.status();
  EXPECT_EQ(recording->keyframes.size(), 581u);
  EXPECT_EQ(recording->rig.pixel_sigma_px, 0.8);
  EXPECT_NEAR(Median(ReprojectionErrors(*recording)), 0.68, 0.02);

  std::vector<double> rotation, velocity, position;
  for (std::size_t k = 1; k < recording->keyframes.size(); ++k) {
    const InertialResidual r =
        EvaluateInertial(recording->imu,
                         recording->keyframes[k - 1].state,
                         recording->keyframes[k].state,
                         recording->rig.factory.imu,
                         recording->rig.imu_noise,
                         recording->rig.gravity_mps2,
                         nullptr,
                         nullptr);
    rotation.push_back(r.segment<3>(0).norm() * 180 / M_PI);
    velocity.push_back(r.segment<3>(3).norm());
    position.push_back(r.segment<3>(6).norm());
  }
  EXPECT_LT(Median(rotation), 0.015);
  EXPECT_LT(Median(velocity), 0.008);
  EXPECT_LT(Median(position), 5e-4);
}

TEST(ReadViMap, TangoRecordingGivesFourteenValidSegments) {
  SELFCAL_NEED_RECORDING(folder, "tango_handheld");
  const auto recording = ReadViMap(folder, {});
  ASSERT_TRUE(recording.ok()) << recording.status();
  const std::vector<MotionSegment> segments =
      BuildSegments(*recording, {.session = recording->session});
  ASSERT_EQ(segments.size(), 14u);
  for (const MotionSegment& segment : segments) {
    EXPECT_EQ(segment.keyframes.size(), 40u);
    for (const Violation& v : Validate(segment, recording->rig.factory)) {
      ADD_FAILURE() << v.field << ": " << v.message;
    }
  }
}

TEST(ReadViMap, SubmapsOfOneRunJoinIntoOneSession) {
  SELFCAL_NEED_RECORDING(folder, "euroc_v1_01");
  const auto recording = ReadViMap(folder, {});
  ASSERT_TRUE(recording.ok()) << recording.status();
  std::size_t separate = 0;
  for (int k = 0; k < 7; ++k) {
    const auto piece = ReadViMap(folder + "/submap_" + std::to_string(k), {});
    ASSERT_TRUE(piece.ok()) << piece.status();
    EXPECT_EQ(piece->session, recording->session);
    separate += piece->keyframes.size();
  }
  EXPECT_EQ(recording->keyframes.size(), separate - 6);
  for (std::size_t k = 1; k < recording->keyframes.size(); ++k) {
    EXPECT_LT(recording->keyframes[k - 1].state.t_ns,
              recording->keyframes[k].state.t_ns);
  }
  for (std::size_t k = 1; k < recording->imu.size(); ++k) {
    EXPECT_LT(recording->imu[k - 1].t_ns, recording->imu[k].t_ns);
  }
  EXPECT_LT(Median(ReprojectionErrors(*recording)), 2.5);
}

TEST(ReadViMap, RefusesSubmapsThatDoNotContinueEachOther) {
  SELFCAL_NEED_RECORDING(folder, "euroc_v1_01");
  const auto recording =
      ReadViMaps({folder + "/submap_0", folder + "/submap_2"}, {});
  EXPECT_EQ(recording.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(recording.status().message()),
              HasSubstr("submap_2: does not continue"));
}

TEST(ReadViMap, EquidistantRecordingReprojects) {
  SELFCAL_NEED_RECORDING(folder, "equidistant_room");
  const auto recording = ReadViMap(folder, {});
  ASSERT_TRUE(recording.ok()) << recording.status();
  EXPECT_EQ(recording->keyframes.size(), 73u);
  EXPECT_EQ(recording->rig.factory.cameras[0].model,
            DistortionModel::kEquidistant);
  EXPECT_NEAR(Median(ReprojectionErrors(*recording)), 0.8, 0.15);
}

TEST(ReadViMap, MissingFolderSaysWhatToGive) {
  const absl::Status status = ReadViMap("/nonexistent", {}).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kNotFound);
  EXPECT_THAT(std::string(status.message()), HasSubstr("vi_map/"));
}

TEST_F(DamagedMap, TruncatedAtAnyPlaceIsRefusedWithItsName) {
  const std::string file = File("vertices0");
  const auto size = fs::file_size(file);
  for (const double part : {0.99999, 0.9, 0.3, 0.001, 0.0}) {
    fs::resize_file(file, static_cast<std::uintmax_t>(size * part));
    const absl::Status status = ReadError();
    EXPECT_FALSE(status.ok()) << part;
    EXPECT_THAT(std::string(status.message()), HasSubstr("vertices0")) << part;
  }
}

TEST_F(DamagedMap, MissingPartIsNamed) {
  fs::remove(File("edges0"));
  EXPECT_EQ(ReadError().code(), absl::StatusCode::kNotFound);
  EXPECT_THAT(std::string(ReadError().message()), HasSubstr("edges0"));
}

TEST_F(DamagedMap, PartOutsideTheFolderIsRefused) {
  std::ofstream(File("vi_map_metadata"))
      << "files { file_type: 0 path: \"../missions\" }";
  EXPECT_EQ(ReadError().code(), absl::StatusCode::kInvalidArgument);
}

// Two bytes each in the file, hundreds in memory.
TEST_F(DamagedMap, MillionsOfEmptyVerticesAreRefused) {
  vi_map::ViMap map;
  for (int i = 0; i < 2'000'000; ++i) map.add_vertices();
  Write("vertices0", map);
  EXPECT_THAT(std::string(ReadError().message()), HasSubstr("too much memory"));
}

TEST_F(DamagedMap, WrongQuaternionNormNamesTheVertex) {
  vi_map::ViMap map = Read("vertices0");
  map.mutable_vertices(3)->set_t_m_i(0, 7.0);
  Write("vertices0", map);
  EXPECT_THAT(std::string(ReadError().message()),
              HasSubstr("vertices[3].T_M_I"));
}

TEST_F(DamagedMap, SigmaThatIsNoNumberNamesTheKeypoint) {
  vi_map::ViMap map = Read("vertices0");
  for (double& sigma : *map.mutable_vertices(2)
                            ->mutable_n_visual_frame()
                            ->mutable_frames(0)
                            ->mutable_keypoint_measurement_sigmas()) {
    sigma = std::nan("");
  }
  Write("vertices0", map);
  EXPECT_THAT(std::string(ReadError().message()),
              HasSubstr("vertices[2].frames[0]: the sigma of keypoint"));
}

TEST_F(DamagedMap, BrokenChainIsRefused) {
  vi_map::ViMap map = Read("edges0");
  map.mutable_edges()->DeleteSubrange(10, 1);
  Write("edges0", map);
  EXPECT_THAT(std::string(ReadError().message()), HasSubstr("the chain"));
}

TEST_F(DamagedMap, ImuColumnsThatDoNotFitAreRefused) {
  vi_map::ViMap map = Read("edges0");
  map.mutable_edges(5)->mutable_viwls()->mutable_imu_data()->RemoveLast();
  Write("edges0", map);
  EXPECT_THAT(std::string(ReadError().message()), HasSubstr("imu_data"));
}

}  // namespace
}  // namespace selfcal::client
