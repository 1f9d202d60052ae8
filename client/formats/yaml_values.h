// Reading and writing the values of YAML files, including those of OpenCV.
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

// Parses a file. Accepts the first line of OpenCV's files, which is not a valid
// directive of YAML 1.2.
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

// Reads a list of lists, or one list of all numbers, row by row.
Eigen::MatrixXd GetMatrix(const YAML::Node& node,
                          const std::string& key,
                          int rows,
                          int cols);
// Reads the same from the field "data", as OpenCV and maplab write it.
Eigen::MatrixXd GetMatrixData(const YAML::Node& node,
                              const std::string& key,
                              int rows,
                              int cols);
// Returns T with its rotation made orthonormal; it must be a rotation to within
// 1e-3.
Eigen::Matrix4d Rigid(const Eigen::MatrixXd& T, const std::string& name);

// The shortest text that reads as the same number, always with a decimal point:
// OpenCV and YAML 1.1 read "1" as an integer and "1e-05" as a string.
std::string NumberText(double value);
// Returns e.g. "[1.0, 2.0]".
std::string ListText(std::span<const double> values);
// Returns a line for each row, e.g. "    - [1.0, 2.0]".
std::string RowsText(const Eigen::MatrixXd& M, const std::string& indent);
// Returns an "!!opencv-matrix" with its rows, columns and data; `type` is 'd',
// or 'f' for a reader that reads elements as floats in any case.
std::string OpenCvMatrixText(const Eigen::MatrixXd& M, char type);

}  // namespace selfcal::client
