#include "client/import/vi_map_files.h"

#include <fmt/format.h>
#include <google/protobuf/io/zero_copy_stream_impl_lite.h>
#include <google/protobuf/text_format.h>
#include <zlib.h>

#include <array>
#include <cstdint>
#include <memory>
#include <utility>

#include "client/import/read_file.h"
#include "proto/parsed_size.h"

namespace selfcal::client {
namespace {

// Limits far above any real map, as a defence against malicious files: on the
// bytes of a part, of all parts, and on what a message takes for each of its
// bytes.
constexpr std::size_t kMaxUncompressedBytes = std::size_t{1} << 30;
constexpr std::int64_t kMaxParsedPerByte = 16;
constexpr std::int64_t kAlwaysAllowed = std::int64_t{64} << 20;

absl::StatusOr<std::string> Gunzip(const std::string& path) {
  std::unique_ptr<gzFile_s, int (*)(gzFile)> file(gzopen(path.c_str(), "rb"),
                                                  &gzclose);
  if (!file) {
    return absl::NotFoundError(
        fmt::format("{}: cannot be opened; the map's metadata lists it", path));
  }
  std::string data;
  std::array<char, 1 << 16> buffer;
  while (true) {
    const int n = gzread(file.get(), buffer.data(), buffer.size());
    if (n < 0) {
      int code = Z_OK;
      return absl::DataLossError(fmt::format(
          "{}: damaged gzip stream: {}", path, gzerror(file.get(), &code)));
    }
    if (n == 0) break;
    data.append(buffer.data(), static_cast<std::size_t>(n));
    if (data.size() > kMaxUncompressedBytes) {
      return absl::InvalidArgumentError(fmt::format(
          "{}: more than 1 GiB uncompressed; not a map part", path));
    }
  }
  // gzread reports no error at the end of a truncated stream.
  int code = Z_OK;
  gzerror(file.get(), &code);
  if (code != Z_OK || gzdirect(file.get()) != 0) {
    return absl::DataLossError(
        fmt::format("{}: truncated, or not a gzip stream", path));
  }
  return data;
}

// True if the name of a part is a plain file name inside the folder. The
// metadata is not trusted.
bool IsPlainName(const std::string& name) {
  return !name.empty() && name.find('/') == std::string::npos && name != ".." &&
         name != ".";
}

}  // namespace

absl::StatusOr<vi_map::ViMap> ReadViMapFiles(const std::string& folder) {
  const std::string base = folder + "/vi_map/";
  const std::string metadata_path = base + "vi_map_metadata";
  absl::StatusOr<std::string> text = ReadFile(metadata_path);
  if (!text.ok()) {
    return absl::NotFoundError(fmt::format(
        "{}: cannot be opened; name a VI-map folder, which contains vi_map/",
        metadata_path));
  }
  vi_map::MapFiles files;
  google::protobuf::TextFormat::Parser parser;
  parser.AllowUnknownField(true);
  if (!parser.ParseFromString(*text, &files) || files.files().empty()) {
    return absl::DataLossError(
        fmt::format("{}: not a list of map files", metadata_path));
  }
  vi_map::ViMap map;
  std::size_t bytes = 0;
  for (const vi_map::MapFile& file : files.files()) {
    if (!IsPlainName(file.path())) {
      return absl::InvalidArgumentError(
          fmt::format("{}: file name '{}' is not a plain name",
                      metadata_path,
                      file.path()));
    }
    absl::StatusOr<std::string> data = Gunzip(base + file.path());
    if (!data.ok()) return data.status();
    bytes += data->size();
    google::protobuf::io::ArrayInputStream stream(
        data->data(), static_cast<int>(data->size()));
    if (bytes > kMaxUncompressedBytes ||
        ParsedSize(*vi_map::ViMap::descriptor(), &stream) >
            kMaxParsedPerByte * static_cast<std::int64_t>(data->size()) +
                kAlwaysAllowed) {
      return absl::InvalidArgumentError(
          fmt::format("{}: the map would take too much memory; not a map part",
                      base + file.path()));
    }
    vi_map::ViMap part;
    if (!part.ParseFromString(*data)) {
      return absl::DataLossError(fmt::format(
          "{}: not a VI-map message, or truncated", base + file.path()));
    }
    map.MergeFrom(part);
  }
  return map;
}

}  // namespace selfcal::client
