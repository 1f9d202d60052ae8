#include "server/store/record_parts.h"

#include <fmt/format.h>

#include <utility>

namespace selfcal::server {
namespace {

using RowMajor =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

// Indices of all components but the time offsets; empty if `size` is not that
// of a tangent space without time offsets.
std::vector<int> WithoutTimeOffsets(const Calibration& theta,
                                    Eigen::Index size) {
  const int cameras = static_cast<int>(theta.cameras.size());
  std::vector<int> places;
  if (size != TangentSize(theta) - cameras) return places;
  for (int i = 0; i < TangentSize(theta); ++i) places.push_back(i);
  for (int j = cameras; j-- > 0;) {
    places.erase(places.begin() + TimeOffsetComponent(theta, j));
  }
  return places;
}

}  // namespace

void AddTimeOffsets(const Calibration& theta, Eigen::MatrixXd* matrix) {
  const std::vector<int> places = WithoutTimeOffsets(theta, matrix->rows());
  if (places.empty() || matrix->cols() != matrix->rows()) return;
  const int size = TangentSize(theta);
  Eigen::MatrixXd larger = Eigen::MatrixXd::Zero(size, size);
  larger(places, places) = *matrix;
  *matrix = std::move(larger);
}

void AddTimeOffsets(const Calibration& theta, Eigen::VectorXd* vector) {
  const std::vector<int> places = WithoutTimeOffsets(theta, vector->size());
  if (places.empty()) return;
  Eigen::VectorXd larger = Eigen::VectorXd::Zero(TangentSize(theta));
  larger(places) = *vector;
  *vector = std::move(larger);
}

void PutMatrix(const Eigen::MatrixXd& matrix, store::MatrixRecord* record) {
  record->set_rows(static_cast<int>(matrix.rows()));
  record->set_columns(static_cast<int>(matrix.cols()));
  record->mutable_values()->Resize(static_cast<int>(matrix.size()), 0.0);
  Eigen::Map<RowMajor>(
      record->mutable_values()->mutable_data(), matrix.rows(), matrix.cols()) =
      matrix;
}

bool GetMatrix(const store::MatrixRecord& record, Eigen::MatrixXd* matrix) {
  const std::int64_t rows = record.rows();
  const std::int64_t columns = record.columns();
  if (rows < 0 || columns < 0 || rows * columns != record.values_size()) {
    return false;
  }
  *matrix = Eigen::Map<const RowMajor>(record.values().data(), rows, columns);
  return true;
}

void PutVector(const Eigen::VectorXd& vector,
               google::protobuf::RepeatedField<double>* values) {
  values->Assign(vector.data(), vector.data() + vector.size());
}

Eigen::VectorXd GetVector(
    const google::protobuf::RepeatedField<double>& values) {
  return Eigen::Map<const Eigen::VectorXd>(values.data(), values.size());
}

void PutDirections(const std::vector<UnobservedDirection>& directions,
                   DirectionMessages* messages) {
  for (const UnobservedDirection& direction : directions) {
    v1::UnobservedDirection* message = messages->Add();
    message->set_information_ratio(direction.information_ratio);
    for (const UnobservedDirection::Part& part : direction.parts) {
      auto* part_message = message->add_parts();
      part_message->set_component(part.component);
      part_message->set_weight(part.weight);
    }
  }
}

std::vector<UnobservedDirection> GetDirections(
    const DirectionMessages& messages) {
  std::vector<UnobservedDirection> directions;
  directions.reserve(messages.size());
  for (const v1::UnobservedDirection& message : messages) {
    UnobservedDirection direction;
    direction.information_ratio = message.information_ratio();
    for (const auto& part : message.parts()) {
      direction.parts.push_back({part.component(), part.weight()});
    }
    directions.push_back(std::move(direction));
  }
  return directions;
}

absl::Status DamagedRecord(const std::string& what) {
  return absl::DataLossError(
      fmt::format("{} cannot be read: its record is malformed; restore the "
                  "database from a backup",
                  what));
}

}  // namespace selfcal::server
