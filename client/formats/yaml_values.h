// Reading and writing the values of YAML files, OpenCV's among them.
//
// Every function that reads throws FormatError, which names the field.
#pragma once

#include <yaml-cpp/yaml.h>

#include <Eigen/Core>
#include <span>
#include <string>
#include <vector>

#include "client/formats/format.h"

namespace selfcal::client {

// OpenCV begins its files with a line that is no directive of YAML 1.2.
YAML::Node ParseYaml(const TextFile& file);

bool Has(const YAML::Node& node, const std::string& key);
YAML::Node Get(const YAML::Node& node, const std::string& key);
double GetDouble(const YAML::Node& node, const std::string& key);
double GetDouble(const YAML::Node& node, const std::string& key, double absent);
int GetInt(const YAML::Node& node, const std::string& key);
std::string GetText(const YAML::Node& node, const std::string& key);
std::vector<int> GetInts(const YAML::Node& node,
                         const std::string& key,
                         std::size_t count);

// A list of lists, or one list of all numbers by rows.
Eigen::MatrixXd GetMatrix(const YAML::Node& node,
                          const std::string& key,
                          int rows,
                          int cols);
// The same under "data", as OpenCV and maplab have it.
Eigen::MatrixXd GetMatrixData(const YAML::Node& node,
                              const std::string& key,
                              int rows,
                              int cols);
// With a rotation that is one within 1e-3, made one exactly.
Eigen::Matrix4d Rigid(const Eigen::MatrixXd& T, const std::string& name);

// The shortest text that reads as the same number, always with a decimal
// point: OpenCV and YAML 1.1 take "1" for an integer and "1e-05" for a word.
std::string NumberText(double value);
// "[1.0, 2.0]"
std::string ListText(std::span<const double> values);
// A line for each row, "    - [1.0, 2.0]".
std::string RowsText(const Eigen::MatrixXd& M, const std::string& indent);
// "!!opencv-matrix" with its rows, columns and data; `type` is 'd', or 'f' for
// a reader that takes the elements for floats whatever they are.
std::string OpenCvMatrixText(const Eigen::MatrixXd& M, char type);

}  // namespace selfcal::client
