#include "client/recording/bag_recording.h"

#include <absl/status/status.h>
#include <absl/strings/escaping.h>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <map>
#include <optional>
#include <utility>

#include "client/recording/bag_files.h"
#include "client/recording/camera_info_message.h"
#include "client/recording/encoded_image.h"
#include "client/recording/order_of_time.h"
#include "client/recording/raw_image.h"
#include "client/recording/ros_messages.h"

namespace selfcal::client {
namespace {

using MessageFiles = std::vector<std::unique_ptr<MessageFile>>;

struct StoredMessage {
  std::size_t file = 0;
  Wire wire = Wire::kCdr;
  MessagePlace place;
};

// Messages that were found of one topic.
struct ImageTopic {
  bool is_compressed = false;
  std::vector<std::int64_t> times_ns;
  std::vector<StoredMessage> messages;
  std::size_t damaged = 0;
};
struct ImuTopic {
  std::vector<ImuSample> samples;
  std::size_t damaged = 0;
};

struct Topics {
  std::map<std::string, ImageTopic> images;
  std::map<std::string, ImuTopic> imus;
  std::map<std::string, absl::StatusOr<CameraCalibration>> calibrations;
};

std::string Names(const auto& topics) {
  std::vector<std::string> names;
  for (const auto& [name, topic] : topics) names.push_back(name);
  return names.empty() ? "none" : fmt::format("{}", fmt::join(names, ", "));
}

bool HasSuffix(const std::string& text, std::string_view suffix) {
  return text.ends_with(suffix) && text.size() > suffix.size();
}

constexpr std::string_view kCompressed = "/compressed";

// "/cam0/image_raw" of "/cam0/image_raw/compressed".
std::string RawTopic(const std::string& topic) {
  return HasSuffix(topic, kCompressed)
             ? topic.substr(0, topic.size() - kCompressed.size())
             : topic;
}

// Reads all files once.
class Collector {
 public:
  Topics Collect(const MessageFiles& files,
                 std::vector<std::string>* problems) {
    for (std::size_t f = 0; f < files.size(); ++f) {
      const absl::Status read = files[f]->Scan(
          [&](const MessageTopic& topic, const MessagePlace& place) {
            Add(topic, {f, topic.wire, place}, files[f].get());
          },
          problems);
      if (!read.ok()) problems->emplace_back(read.message());
    }
    return std::move(topics_);
  }

 private:
  void Add(const MessageTopic& topic,
           const StoredMessage& message,
           MessageFile* file) {
    // A damaged name must not damage a terminal.
    const std::string name = absl::Utf8SafeCHexEscape(topic.name);
    if (topic.type == "sensor_msgs/Image") {
      AddImage(message, file, &topics_.images[name]);
    } else if (topic.type == "sensor_msgs/CompressedImage") {
      ImageTopic& images = topics_.images[name];
      images.is_compressed = true;
      AddImage(message, file, &images);
    } else if (topic.type == "sensor_msgs/Imu") {
      AddReading(message, file, &topics_.imus[name]);
    } else if (topic.type == "sensor_msgs/CameraInfo" &&
               !topics_.calibrations.contains(name)) {
      AddCalibration(name, message, file);
    }
  }

  static void AddImage(const StoredMessage& message,
                       MessageFile* file,
                       ImageTopic* topic) {
    const auto bytes = file->Read(message.place, kStampBytes);
    const auto t_ns = bytes.ok() ? ParseStamp(message.wire, *bytes)
                                 : absl::StatusOr<std::int64_t>(bytes.status());
    if (!t_ns.ok()) {
      ++topic->damaged;
      return;
    }
    topic->times_ns.push_back(*t_ns);
    topic->messages.push_back(message);
  }

  static void AddReading(const StoredMessage& message,
                         MessageFile* file,
                         ImuTopic* topic) {
    const auto bytes = file->Read(message.place, message.place.size);
    const auto sample = bytes.ok() ? ParseImu(message.wire, *bytes)
                                   : absl::StatusOr<ImuSample>(bytes.status());
    if (sample.ok()) {
      topic->samples.push_back(*sample);
    } else {
      ++topic->damaged;
    }
  }

  void AddCalibration(const std::string& name,
                      const StoredMessage& message,
                      MessageFile* file) {
    const auto bytes = file->Read(message.place, message.place.size);
    if (!bytes.ok()) return;
    const auto info = ParseCameraInfo(message.wire, *bytes);
    if (!info.ok()) return;
    topics_.calibrations.emplace(name, CalibrationOf(*info));
  }

  Topics topics_;
};

class BagRecording : public Recording {
 public:
  BagRecording(std::string path,
               RecordedData data,
               std::vector<ImageTopic> images,
               MessageFiles files)
      : Recording(std::move(data)),
        path_(std::move(path)),
        images_(std::move(images)),
        files_(std::move(files)) {}

  absl::StatusOr<GreyPixels> ReadImage(int camera, int image) override {
    const ImageTopic& topic = images_[static_cast<std::size_t>(camera)];
    const auto k = static_cast<std::size_t>(image);
    const RecordedCamera& recorded =
        cameras()[static_cast<std::size_t>(camera)];
    return Checked(Decode(topic, topic.messages[k]),
                   fmt::format("{}: image {} of {}",
                               path_,
                               recorded.image_times_ns[k],
                               recorded.name),
                   camera);
  }

 private:
  absl::StatusOr<GreyPixels> Decode(const ImageTopic& topic,
                                    const StoredMessage& message) {
    const auto bytes =
        files_[message.file]->Read(message.place, message.place.size);
    if (!bytes.ok()) return bytes.status();
    if (topic.is_compressed) {
      const auto encoded = ParseCompressedImage(message.wire, *bytes);
      if (!encoded.ok()) return encoded.status();
      return DecodeImage(*encoded);
    }
    const auto image = ParseImage(message.wire, *bytes);
    if (!image.ok()) return image.status();
    return ConvertImage(*image);
  }

  const std::string path_;
  const std::vector<ImageTopic> images_;
  const MessageFiles files_;
};

// Selects the topics and makes their lists.
class Selection {
 public:
  Selection(std::string path,
            const RecordingOptions& options,
            Topics topics,
            std::vector<std::string> problems)
      : path_(std::move(path)), options_(options), topics_(std::move(topics)) {
    data_.problems = std::move(problems);
  }

  absl::StatusOr<std::unique_ptr<Recording>> Make(MessageFiles files) {
    // Topics of which no message could be read are none.
    std::erase_if(topics_.images, [](const auto& topic) {
      return topic.second.times_ns.empty();
    });
    std::erase_if(topics_.imus, [](const auto& topic) {
      return topic.second.samples.empty();
    });
    const auto cameras = CameraTopics();
    if (!cameras.ok()) return cameras.status();
    const auto imus = ImuTopicNames();
    if (!imus.ok()) return imus.status();
    for (const std::string& name : *cameras) AddCamera(name);
    data_.imu = TakeReadings(imus->front());
    if (imus->size() > 1) data_.imu1 = TakeReadings(imus->back());
    return std::make_unique<BagRecording>(
        path_, std::move(data_), std::move(images_), std::move(files));
  }

 private:
  absl::StatusOr<std::vector<std::string>> CameraTopics() {
    if (topics_.images.empty()) return NotFound("images");
    if (options_.camera_topics.empty()) return FoundCameraTopics();
    for (const std::string& name : options_.camera_topics) {
      if (topics_.images.contains(name)) continue;
      return absl::NotFoundError(
          fmt::format("{}: there are no images in {}; topics with images: {}",
                      path_,
                      name,
                      Names(topics_.images)));
    }
    return options_.camera_topics;
  }

  // All of them, but none twice, and no depth.
  absl::StatusOr<std::vector<std::string>> FoundCameraTopics() {
    std::vector<std::string> names;
    for (const auto& [name, topic] : topics_.images) {
      if (HasSuffix(name, "/compressedDepth")) continue;
      if (topic.is_compressed && RawTopic(name) != name &&
          topics_.images.contains(RawTopic(name))) {
        data_.problems.push_back(
            fmt::format("{}: {} is not read: {} has its images uncompressed",
                        path_,
                        name,
                        RawTopic(name)));
        continue;
      }
      names.push_back(name);
    }
    if (names.empty()) return NotFound("images");
    return names;
  }

  // That of the IMU, and of the second one if it is wanted.
  absl::StatusOr<std::vector<std::string>> ImuTopicNames() {
    if (topics_.imus.empty()) return NotFound("readings of an IMU");
    const std::vector<std::string>& names = options_.imu_topics;
    for (const std::string& name : names) {
      if (topics_.imus.contains(name)) continue;
      return absl::NotFoundError(
          fmt::format("{}: there are no readings in {}; topics with readings: "
                      "{}",
                      path_,
                      name,
                      Names(topics_.imus)));
    }
    if (names.size() > 2 || (names.size() == 2 && names[0] == names[1])) {
      return absl::InvalidArgumentError(
          "--imu-topic: state one topic, or two different ones for two IMUs");
    }
    if (!names.empty()) return names;
    if (topics_.imus.size() > 1) {
      return absl::InvalidArgumentError(
          fmt::format("{}: there are {} topics with readings of an IMU, {}: "
                      "state one with --imu-topic",
                      path_,
                      topics_.imus.size(),
                      Names(topics_.imus)));
    }
    return std::vector<std::string>{topics_.imus.begin()->first};
  }

  std::vector<ImuSample> TakeReadings(const std::string& topic) {
    ImuTopic& readings = topics_.imus.at(topic);
    const std::string where = fmt::format("{}: {}", path_, topic);
    ReportDamaged(where, readings.damaged, "readings");
    SortByTime(where, &readings.samples, &data_.problems);
    return std::move(readings.samples);
  }

  // The reason may be that the file is damaged.
  absl::Status NotFound(std::string_view what) const {
    std::string sentence =
        fmt::format("{}: there are no {} in it", path_, what);
    for (const std::string& problem : data_.problems)
      sentence += "; " + problem;
    return absl::NotFoundError(sentence);
  }

  void AddCamera(const std::string& name) {
    const ImageTopic& found = topics_.images.at(name);
    const std::string where = fmt::format("{}: {}", path_, name);
    ReportDamaged(where, found.damaged, "images");
    RecordedCamera camera;
    camera.name = name;
    ImageTopic sorted;
    sorted.is_compressed = found.is_compressed;
    for (const std::size_t k :
         OrderOfTime(found.times_ns, where, "images", &data_.problems)) {
      camera.image_times_ns.push_back(found.times_ns[k]);
      sorted.messages.push_back(found.messages[k]);
    }
    AddCalibration(name, &camera);
    data_.cameras.push_back(std::move(camera));
    images_.push_back(std::move(sorted));
  }

  void AddCalibration(const std::string& name, RecordedCamera* camera) {
    const std::string raw = RawTopic(name);
    const std::string info = raw.substr(0, raw.rfind('/') + 1) + "camera_info";
    const auto found = topics_.calibrations.find(info);
    if (found == topics_.calibrations.end()) return;
    if (found->second.ok()) {
      camera->calibration = *found->second;
      return;
    }
    data_.problems.push_back(
        fmt::format("{}: {} is not used: {}",
                    path_,
                    info,
                    std::string(found->second.status().message())));
  }

  void ReportDamaged(const std::string& where,
                     std::size_t damaged,
                     std::string_view what) {
    if (damaged == 0) return;
    data_.problems.push_back(
        fmt::format("{}: {} {} are damaged: left out", where, damaged, what));
  }

  const std::string path_;
  const RecordingOptions& options_;
  Topics topics_;
  RecordedData data_;
  std::vector<ImageTopic> images_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<Recording>> OpenBag(
    const std::string& path, const RecordingOptions& options) {
  std::vector<std::string> problems;
  auto files = OpenBagFiles(path, &problems);
  if (!files.ok()) return files.status();
  Topics topics = Collector().Collect(*files, &problems);
  return Selection(path, options, std::move(topics), std::move(problems))
      .Make(*std::move(files));
}

}  // namespace selfcal::client
