#include "client/formats/yaml_values.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <Eigen/SVD>
#include <cmath>

#include "client/formats/format_error.h"

namespace selfcal::client {
namespace {

template <typename T>
T As(const YAML::Node& node, const std::string& key, const char* what) {
  try {
    return node.as<T>();
  } catch (const YAML::Exception&) {
    throw FormatError(fmt::format("field '{}' is not {}", key, what));
  }
}

double Finite(const YAML::Node& node, const std::string& key) {
  const auto value = As<double>(node, key, "a number");
  if (std::isfinite(value)) return value;
  throw FormatError(fmt::format("field '{}' is not finite", key));
}

Eigen::MatrixXd ReadMatrix(const YAML::Node& list,
                           const std::string& key,
                           int rows,
                           int cols) {
  std::vector<double> values;
  for (const YAML::Node& entry : list) {
    if (!entry.IsSequence()) {
      values.push_back(Finite(entry, key));
      continue;
    }
    for (const YAML::Node& value : entry) values.push_back(Finite(value, key));
  }
  if (static_cast<int>(values.size()) != rows * cols) {
    throw FormatError(fmt::format("field '{}' needs {} x {} numbers, not {}",
                                  key,
                                  rows,
                                  cols,
                                  values.size()));
  }
  return Eigen::Map<Eigen::Matrix<double, -1, -1, Eigen::RowMajor>>(
      values.data(), rows, cols);
}

}  // namespace

YAML::Node ParseYaml(const TextFile& file) {
  std::string text = file.text;
  if (text.rfind("%YAML:", 0) == 0) {
    const std::size_t end = text.find('\n');
    text.erase(0, end == std::string::npos ? text.size() : end + 1);
  }
  try {
    return YAML::Load(text);
  } catch (const YAML::Exception& error) {
    throw FormatError(error.what());
  }
}

bool Has(const YAML::Node& node, const std::string& key) {
  return node.IsMap() && node[key];
}

YAML::Node Get(const YAML::Node& node, const std::string& key) {
  if (!Has(node, key)) {
    throw FormatError(fmt::format("field '{}' is missing", key));
  }
  return node[key];
}

double GetDouble(const YAML::Node& node, const std::string& key) {
  return Finite(Get(node, key), key);
}

double GetDouble(const YAML::Node& node,
                 const std::string& key,
                 double absent) {
  return Has(node, key) ? GetDouble(node, key) : absent;
}

int GetInt(const YAML::Node& node, const std::string& key) {
  return As<int>(Get(node, key), key, "an integer");
}

std::string GetText(const YAML::Node& node, const std::string& key) {
  return As<std::string>(Get(node, key), key, "a text");
}

std::vector<int> GetInts(const YAML::Node& node,
                         const std::string& key,
                         std::size_t count) {
  std::vector<int> values;
  for (const YAML::Node& value : Get(node, key)) {
    values.push_back(As<int>(value, key, "a list of integers"));
  }
  if (values.size() == count) return values;
  throw FormatError(fmt::format("field '{}' needs {} numbers", key, count));
}

Eigen::MatrixXd GetMatrix(const YAML::Node& node,
                          const std::string& key,
                          int rows,
                          int cols) {
  return ReadMatrix(Get(node, key), key, rows, cols);
}

Eigen::MatrixXd GetMatrixData(const YAML::Node& node,
                              const std::string& key,
                              int rows,
                              int cols) {
  return ReadMatrix(Get(Get(node, key), "data"), key, rows, cols);
}

Eigen::Matrix4d Rigid(const Eigen::MatrixXd& T, const std::string& name) {
  const Eigen::Matrix3d R = T.topLeftCorner(3, 3);
  if (!((R * R.transpose() - Eigen::Matrix3d::Identity()).norm() < 1e-3) ||
      !(R.determinant() > 0) || !(T.row(3) == Eigen::RowVector4d(0, 0, 0, 1))) {
    throw FormatError(fmt::format("field '{}' is not a rigid transform", name));
  }
  Eigen::Matrix4d rigid = T;
  rigid.topLeftCorner<3, 3>() =
      Eigen::Quaterniond(R).normalized().toRotationMatrix();
  return rigid;
}

std::string NumberText(double value) {
  std::string text = fmt::format("{}", value);
  if (text.find('.') != std::string::npos) return text;
  return text.insert(std::min(text.find('e'), text.size()), ".0");
}

std::string ListText(std::span<const double> values) {
  std::vector<std::string> texts;
  for (const double value : values) texts.push_back(NumberText(value));
  return fmt::format("[{}]", fmt::join(texts, ", "));
}

std::string RowsText(const Eigen::MatrixXd& M, const std::string& indent) {
  std::string text;
  for (Eigen::Index i = 0; i < M.rows(); ++i) {
    const Eigen::RowVectorXd row = M.row(i);
    text += fmt::format(
        "{}- {}\n",
        indent,
        ListText({row.data(), static_cast<std::size_t>(row.size())}));
  }
  return text;
}

std::string OpenCvMatrixText(const Eigen::MatrixXd& M, char type) {
  const Eigen::Matrix<double, -1, -1, Eigen::RowMajor> by_rows = M;
  return fmt::format(
      "!!opencv-matrix\n  rows: {}\n  cols: {}\n  dt: {}\n  data: {}\n",
      M.rows(),
      M.cols(),
      type,
      ListText({by_rows.data(), static_cast<std::size_t>(by_rows.size())}));
}

}  // namespace selfcal::client
