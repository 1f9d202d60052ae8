#include "server/store/record_parts.h"

#include <fmt/format.h>

#include <cstdint>
#include <utility>
#include <vector>

#include "proto/convert.h"
#include "server/convert/convert.h"

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

void PutStep(const CalibrateProgress& step, store::StepRecord* record) {
  record->set_iteration(step.iteration);
  record->set_max_iterations(step.max_iterations);
  record->set_cost(step.cost);
  record->set_step_sigmas(step.step_sigmas);
  if (step.sigmas.size() == 0) return;
  *record->mutable_theta() = ToProto(step.theta);
  ToProto(step.moved, record->mutable_moved());
  ToProto(step.sigmas, record->mutable_sigmas());
}

bool GetStep(const store::StepRecord& record, CalibrateProgress* step) {
  step->iteration = record.iteration();
  step->max_iterations = record.max_iterations();
  step->cost = record.cost();
  step->step_sigmas = record.step_sigmas();
  if (record.sigmas().empty()) return true;
  if (!FromProto(record.theta(), "", &step->theta).empty()) return false;
  const int size = TangentSize(step->theta);
  if (record.moved_size() != size || record.sigmas_size() != size) return false;
  step->moved = FromProto(record.moved());
  step->sigmas = FromProto(record.sigmas());
  return true;
}

absl::Status DamagedRecord(const std::string& what) {
  return absl::DataLossError(
      fmt::format("{} cannot be read: its record is malformed; restore the "
                  "database from a backup",
                  what));
}

}  // namespace selfcal::server
