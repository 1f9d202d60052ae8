#include "test/client/formats/loaders.h"

#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <optional>
#include <set>
#include <span>

#include "test/client/formats/loader_tables.h"

namespace selfcal::client {
namespace {

using Table = std::vector<Key>;

Table Joined(std::initializer_list<std::span<const Key>> parts) {
  Table table;
  for (const std::span<const Key>& part : parts) {
    table.insert(table.end(), part.begin(), part.end());
  }
  return table;
}

bool IsQuoted(const YAML::Node& node) { return node.Tag() == "!"; }

std::optional<double> Number(const YAML::Node& node) {
  double value = 0;
  if (!node.IsScalar() || IsQuoted(node) ||
      !YAML::convert<double>::decode(node, value)) {
    return std::nullopt;
  }
  return value;
}

bool HasPoint(const YAML::Node& node) {
  return node.Scalar().find_first_of(".eE") != std::string::npos;
}

// Numbers with a decimal point, without one, or both.
bool AreNumbers(const YAML::Node& list,
                int count,
                Type type,
                const Range& range) {
  if (!list.IsSequence() || static_cast<int>(list.size()) != count) {
    return false;
  }
  return std::all_of(list.begin(), list.end(), [&](const YAML::Node& node) {
    const std::optional<double> value = Number(node);
    if (!value || *value < range.least || *value > range.most) return false;
    return type == Type::kNumber || HasPoint(node) == (type == Type::kReal);
  });
}

bool AreRows(const YAML::Node& rows, const Key& key) {
  if (!rows.IsSequence() || static_cast<int>(rows.size()) != key.rows) {
    return false;
  }
  return std::all_of(rows.begin(), rows.end(), [&](const YAML::Node& row) {
    return AreNumbers(row, key.cols, Type::kReal, key.range);
  });
}

bool IsMapMatrix(const YAML::Node& node, const Key& key) {
  return node.IsMap() && node["rows"].as<int>(0) == key.rows &&
         node["cols"].as<int>(0) == key.cols &&
         (AreNumbers(
              node["data"], key.rows * key.cols, Type::kNumber, key.range) ||
          AreRows(node["data"], key));
}

bool IsOpenCvMatrix(const YAML::Node& node, const Key& key) {
  return IsMapMatrix(node, key) &&
         node.Tag().find("opencv-matrix") != std::string::npos &&
         node["data"].size() == 16 && node["dt"];
}

bool Fits(const YAML::Node& node, const Key& key) {
  const auto list = [&](Type type) {
    return AreNumbers(node, key.rows * key.cols, type, key.range);
  };
  const auto one = [&](Type type) {
    YAML::Node single;
    single.push_back(node);
    return AreNumbers(single, 1, type, key.range);
  };
  switch (key.type) {
    case Type::kText:
      return node.IsScalar() && !Number(node);
    case Type::kInteger:
    case Type::kReal:
    case Type::kNumber:
      return one(key.type);
    case Type::kMap:
      return node.IsMap();
    case Type::kList:
      return node.IsSequence();
    case Type::kIntegers:
      return list(Type::kInteger);
    case Type::kReals:
      return list(Type::kReal);
    case Type::kNumbers:
      return list(Type::kNumber);
    case Type::kRows:
      return AreRows(node, key);
    case Type::kOpenCvMatrix:
      return IsOpenCvMatrix(node, key);
    case Type::kMapMatrix:
      return IsMapMatrix(node, key);
  }
  return false;
}

class Checker {
 public:
  // Compares `root` with the table. Keys may contain dots themselves, or lead
  // into maps.
  void Check(const std::string& where,
             const YAML::Node& root,
             const Table& table) {
    std::set<std::string> known;
    for (const Key& key : table) {
      known.insert(key.path);
      const YAML::Node node = Find(root, key.path);
      if (!node || node.IsNull()) {
        if (key.use == Use::kRequired) Add(where, key.path, "is missing");
      } else if (key.use == Use::kSetting) {
        Add(where, key.path, "is not part of a calibration");
      } else if (!Fits(node, key)) {
        Add(where, key.path, "does not have the type or range: ");
        faults_.back() += YAML::Dump(node);
      }
    }
    AddUnknown(where, root, "", known);
  }

  void Expect(bool holds, const std::string& fault) {
    if (!holds) faults_.push_back(fault);
  }

  std::vector<std::string> Faults() { return faults_; }

 private:
  static YAML::Node Find(const YAML::Node& root, const std::string& path) {
    if (!root.IsMap()) return {};
    if (root[path]) return root[path];
    const std::size_t dot = path.find('.');
    if (dot == std::string::npos || !root[path.substr(0, dot)]) return {};
    return Find(root[path.substr(0, dot)], path.substr(dot + 1));
  }

  void Add(const std::string& where,
           const std::string& key,
           const std::string& fault) {
    faults_.push_back(fmt::format("{}: {} {}", where, key, fault));
  }

  void AddUnknown(const std::string& where,
                  const YAML::Node& root,
                  const std::string& prefix,
                  const std::set<std::string>& known) {
    if (!root.IsMap()) {
      Add(where, prefix, "is not a map");
      return;
    }
    for (const auto& entry : root) {
      const std::string path = prefix + entry.first.as<std::string>();
      if (known.count(path) == 0) {
        Add(where, path, "is not in the table of the loader");
        continue;
      }
      const auto next = known.lower_bound(path + ".");
      const bool leads = next != known.end() && next->rfind(path + ".", 0) == 0;
      if (leads) AddUnknown(where, entry.second, path + ".", known);
    }
  }

  std::vector<std::string> faults_;
};

YAML::Node Yaml(const TextFile& file) {
  const bool opencv = file.text.rfind("%YAML:1.0\n", 0) == 0;
  return YAML::Load(opencv ? file.text.substr(10) : file.text);
}

// OpenCV takes a file for YAML by this line.
void ExpectOpenCv(const TextFile& file, Checker* checker) {
  checker->Expect(file.text.rfind("%YAML:1.0\n", 0) == 0,
                  file.name + " does not begin with %YAML:1.0");
}

std::string Text(const YAML::Node& node, const char* key) {
  return node[key].as<std::string>("");
}

void CheckKalibr(const std::vector<TextFile>& files, Checker* checker) {
  int number = 0;
  for (const auto& entry : Yaml(files[0])) {
    const auto name = entry.first.as<std::string>();
    checker->Expect(name == fmt::format("cam{}", number),
                    name + " is counted as a camera");
    const std::string model = Text(entry.second, "camera_model");
    const std::string distortion = Text(entry.second, "distortion_model");
    Table table =
        Joined({kKalibrCamera,
                model == "omni"   ? std::span<const Key>(kKalibrOmni)
                : model == "eucm" ? std::span<const Key>(kKalibrEucm)
                : model == "ds"   ? std::span<const Key>(kKalibrDs)
                                  : kKalibrPinhole,
                distortion == "fov"    ? std::span<const Key>(kKalibrFov)
                : distortion == "none" ? std::span<const Key>(kKalibrNone)
                                       : kKalibrFourCoefficients});
    if (number > 0) table = Joined({table, kKalibrNextCamera});
    checker->Check(name, entry.second, table);
    ++number;
  }
  checker->Check(files[1].name, Yaml(files[1]), Joined({kKalibrImu}));
  if (files.size() < 3) return;
  checker->Check(
      files[2].name, Yaml(files[2]), Joined({kKalibrImu, kKalibrSecondImu}));
}

void CheckOpenVins(const std::vector<TextFile>& files, Checker* checker) {
  for (const TextFile& file : files) ExpectOpenCv(file, checker);
  for (const auto& entry : Yaml(files[0])) {
    checker->Check(
        entry.first.as<std::string>(), entry.second, Joined({kOpenVinsCamera}));
  }
  checker->Check(files[1].name, Yaml(files[1]), Joined({kOpenVinsImu}));
}

void CheckOrbSlam3(const std::vector<TextFile>& files, Checker* checker) {
  ExpectOpenCv(files[0], checker);
  const YAML::Node root = Yaml(files[0]);
  const bool pinhole = Text(root, "Camera.type") == "PinHole";
  Table table = Joined(
      {kOrbSlam3,
       pinhole ? std::span<const Key>(kOrbSlam3Pinhole) : kOrbSlam3Fisheye});
  if (root["Camera2.fx"]) {
    table = Joined({table,
                    kOrbSlam3Stereo,
                    pinhole ? std::span<const Key>(kOrbSlam3StereoPinhole)
                            : kOrbSlam3StereoFisheye});
  }
  checker->Check(files[0].name, root, table);
}

void CheckVinsFusion(const std::vector<TextFile>& files, Checker* checker) {
  for (const TextFile& file : files) ExpectOpenCv(file, checker);
  const YAML::Node root = Yaml(files[0]);
  Table table = Joined({kVinsFusion});
  const int cameras = root["num_of_cam"].as<int>(0);
  if (cameras == 2) table = Joined({table, kVinsFusionStereo});
  checker->Check(files[0].name, root, table);
  checker->Expect(static_cast<int>(files.size()) == 1 + cameras,
                  "there is not one file for each camera");
  for (std::size_t j = 1; j < files.size(); ++j) {
    const YAML::Node camera = Yaml(files[j]);
    const std::string type = Text(camera, "model_type");
    Table rest = type == "MEI"              ? Joined({kVinsFusionMei})
                 : type == "KANNALA_BRANDT" ? Joined({kVinsFusionFisheye})
                                            : Joined({kVinsFusionPinhole});
    if (type == "PINHOLE_FULL") rest = Joined({rest, kVinsFusionFull});
    checker->Check(files[j].name, camera, Joined({kVinsFusionCamera, rest}));
  }
}

void CheckBasalt(const std::vector<TextFile>& files, Checker* checker) {
  const YAML::Node root = Yaml(files[0])["value0"];
  // The values of lists are checked below.
  checker->Check(files[0].name, root, Joined({kBasalt}));
  for (const YAML::Node& pose : root["T_imu_cam"]) {
    checker->Check("T_imu_cam", pose, Joined({kBasaltPose}));
  }
  for (const YAML::Node& camera : root["intrinsics"]) {
    const std::string type = Text(camera, "camera_type");
    // GenericCamera's alternatives are eucm, ds, kb4, ucm, pinhole and
    // pinhole-radtan8.
    const bool four = type == "kb4" || type == "pinhole-radtan8";
    checker->Expect(four || type == "eucm" || type == "ds",
                    "camera_type " + type + " is none of Basalt's");
    Table table = Joined({kBasaltCamera,
                          four           ? std::span<const Key>(kBasaltKb4)
                          : type == "ds" ? std::span<const Key>(kBasaltDs)
                                         : kBasaltEucm});
    if (type == "pinhole-radtan8") table = Joined({table, kBasaltRadTan8});
    checker->Check("intrinsics", camera, table);
  }
  for (const YAML::Node& size : root["resolution"]) {
    checker->Expect(AreNumbers(size, 2, Type::kInteger, kAbove0),
                    "resolution is not two integers");
  }
}

void CheckMaplab(const std::vector<TextFile>& files, Checker* checker) {
  const YAML::Node root = Yaml(files[0]);
  std::set<std::string> placed;
  for (const YAML::Node& place : root["extrinsics"]) {
    checker->Check("extrinsics", place, Joined({kMaplabExtrinsics}));
    placed.insert(Text(place, "sensor_id"));
  }
  for (const YAML::Node& sensor : root["sensors"]) {
    checker->Expect(placed.count(Text(sensor, "id")) == 1,
                    "a sensor has no extrinsics");
    const std::string type = Text(sensor, "sensor_type");
    const bool imu = type == "IMU";
    checker->Expect(imu || type == "NCAMERA", "sensor_type " + type);
    checker->Check(
        type,
        sensor,
        Joined({imu ? std::span<const Key>(kMaplabImu) : kMaplabCameras}));
    if (imu) continue;
    for (const YAML::Node& camera : sensor["cameras"]) {
      const bool fisheye =
          Text(camera["camera"]["distortion"], "type") == "fisheye";
      checker->Check("cameras",
                     camera,
                     Joined({kMaplabCamera,
                             Text(camera["camera"], "type") == "pinhole"
                                 ? std::span<const Key>(kMaplabPinhole)
                                 : kMaplabUnified,
                             fisheye ? std::span<const Key>(kMaplabFisheye)
                                     : kMaplabFourCoefficients}));
    }
  }
}

void CheckCameraInfo(const std::vector<TextFile>& files, Checker* checker) {
  for (const TextFile& file : files) {
    const YAML::Node root = Yaml(file);
    const std::string type = Text(root, "distortion_model");
    checker->Check(
        file.name,
        root,
        Joined({kCameraInfo,
                type == "plumb_bob" ? std::span<const Key>(kCameraInfoPlumbBob)
                : type == "rational_polynomial"
                    ? std::span<const Key>(kCameraInfoRational)
                    : std::span<const Key>(kCameraInfoEquidistant)}));
    checker->Expect(type == "plumb_bob" || type == "rational_polynomial" ||
                        type == "equidistant",
                    "distortion_model " + type);
  }
}

}  // namespace

std::vector<std::string> LoaderFaults(const std::string& format,
                                      const std::vector<TextFile>& files) {
  Checker checker;
  if (format == "kalibr") CheckKalibr(files, &checker);
  if (format == "openvins") CheckOpenVins(files, &checker);
  if (format == "orb_slam3") CheckOrbSlam3(files, &checker);
  if (format == "vins_fusion") CheckVinsFusion(files, &checker);
  if (format == "basalt") CheckBasalt(files, &checker);
  if (format == "maplab") CheckMaplab(files, &checker);
  if (format == "camera_info") CheckCameraInfo(files, &checker);
  return checker.Faults();
}

}  // namespace selfcal::client
