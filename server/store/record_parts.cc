#include "server/store/record_parts.h"

#include <fmt/format.h>
#include <google/protobuf/io/zero_copy_stream_impl_lite.h>

#include <algorithm>
#include <cstdint>
#include <iterator>
#include <utility>
#include <vector>

#include "core/model/parameter_blocks.h"
#include "proto/convert.h"
#include "proto/parsed_size.h"
#include "server/convert/convert.h"

namespace selfcal::server {
namespace {

using RowMajor =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

// Indices of the components of the blocks that records had at a time.
std::vector<int> StoredComponents(const Calibration& theta, StoredSince time) {
  std::vector<int> places;
  VisitBlocks(
      [&](const BlockPlace& place, const auto& value) {
        if (place.info.since > time) return;
        for (int i = 0; i < TangentDimension(value); ++i) {
          places.push_back(place.offset + i);
        }
      },
      theta);
  return places;
}

// Indices of the components with these names; empty if theta lacks one.
std::vector<int> NamedComponents(const Calibration& theta,
                                 const ComponentNames& names) {
  const std::vector<TangentComponent> components = TangentComponents(theta);
  std::vector<int> places;
  for (const std::string& name : names) {
    const auto found = std::find_if(
        components.begin(), components.end(), [&](const auto& component) {
          return component.name == name;
        });
    if (found == components.end()) return {};
    places.push_back(static_cast<int>(found - components.begin()));
  }
  return places;
}

// Where `size` entries of a record belong, and in `all` how many there are
// with those that it lacks.
bool FindPlaces(const Calibration& theta,
                const ComponentNames& names,
                Eigen::Index size,
                int more,
                std::vector<int>* places,
                int* all) {
  places->clear();
  const auto fits = [&] {
    return static_cast<Eigen::Index>(places->size()) + more == size;
  };
  if (!names.empty()) {
    *places = NamedComponents(theta, names);
    if (!fits()) return false;
  } else {
    for (const auto time : {StoredSince::kTimeOffset, StoredSince::kBegin}) {
      *places = StoredComponents(theta, time);
      if (fits()) break;
    }
  }
  *all = TangentSize(theta) + more;
  for (int i = 0; i < more; ++i) places->push_back(*all - more + i);
  return true;
}

}  // namespace

bool ParseStored(std::string_view bytes, google::protobuf::Message* message) {
  constexpr std::int64_t kMostPerByte = 16;
  constexpr std::int64_t kAlwaysAllowed = 1 << 20;
  const auto size = static_cast<int>(bytes.size());
  google::protobuf::io::ArrayInputStream stream(bytes.data(), size);
  return ParsedSize(*message->GetDescriptor(), &stream) <=
             kMostPerByte * size + kAlwaysAllowed &&
         message->ParseFromArray(bytes.data(), size);
}

void PutComponents(const Calibration& theta,
                   Eigen::Index size,
                   ComponentNames* names) {
  if (size != TangentSize(theta)) return;
  for (TangentComponent& component : TangentComponents(theta)) {
    *names->Add() = std::move(component.name);
  }
}

bool ToTangent(const Calibration& theta,
               const ComponentNames& names,
               Eigen::MatrixXd* matrix,
               int more) {
  const Eigen::Index size = matrix->rows();
  if (size == 0 && matrix->cols() == 0) return true;
  std::vector<int> places;
  int all = 0;
  if (!FindPlaces(theta, names, size, more, &places, &all)) return false;
  if (matrix->cols() != size) return names.empty();
  if (std::ssize(places) != size) return true;
  Eigen::MatrixXd larger = Eigen::MatrixXd::Zero(all, all);
  larger(places, places) = *matrix;
  *matrix = std::move(larger);
  return true;
}

bool ToTangent(const Calibration& theta,
               const ComponentNames& names,
               Eigen::VectorXd* vector,
               int more) {
  const Eigen::Index size = vector->size();
  if (size == 0) return true;
  std::vector<int> places;
  int all = 0;
  if (!FindPlaces(theta, names, size, more, &places, &all)) return false;
  if (std::ssize(places) != size) return true;
  Eigen::VectorXd larger = Eigen::VectorXd::Zero(all);
  larger(places) = *vector;
  *vector = std::move(larger);
  return true;
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

bool GetStep(const store::StepRecord& record,
             const ComponentNames& names,
             CalibrateProgress* step) {
  step->iteration = record.iteration();
  step->max_iterations = record.max_iterations();
  step->cost = record.cost();
  step->step_sigmas = record.step_sigmas();
  if (record.sigmas().empty()) return true;
  if (!FromProto(record.theta(), "", &step->theta).empty()) return false;
  step->moved = FromProto(record.moved());
  step->sigmas = FromProto(record.sigmas());
  const int size = TangentSize(step->theta);
  return ToTangent(step->theta, names, &step->moved) &&
         ToTangent(step->theta, names, &step->sigmas) &&
         step->moved.size() == size && step->sigmas.size() == size;
}

absl::Status DamagedRecord(const std::string& what) {
  return absl::DataLossError(
      fmt::format("{} cannot be read: its record is malformed; restore the "
                  "database from a backup",
                  what));
}

}  // namespace selfcal::server
