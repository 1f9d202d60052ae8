#include "core/elimination/chain_elimination.h"

#include <algorithm>

#include "core/elimination/chain_places.h"
#include "core/elimination/landmark_rows.h"

namespace selfcal {

using namespace chain;

void ChainElimination::LayOut(const ChainShape& shape) {
  camera_sizes_.assign(shape.camera_sizes.begin(), shape.camera_sizes.end());
  camera_offsets_.clear();
  sums_offsets_.clear();
  landmark_shared_ = 0;
  sums_size_ = 0;
  int largest_row = 0;
  for (const int size : camera_sizes_) {
    camera_offsets_.push_back(landmark_shared_);
    landmark_shared_ += size;
    sums_offsets_.push_back(sums_size_);
    sums_size_ += 3 * RowsStride(size);
    largest_row = std::max(largest_row, RowsStride(size));
  }
  kept_ = shape.kept;
  landmark_place_ = kKeptPlace + WholeVectors(kept_);
  constant_ = landmark_place_ + landmark_shared_;
  fixed_ = WholeVectors(constant_ + 1);
  GrowTo(static_cast<std::size_t>(largest_row) * (largest_row + kPanelPad),
         &gram_);

  const int slots = structure_.max_slots();
  // The front advances by one place with each keyframe, and is moved back at
  // its end.
  places_ = std::max(
      places_,
      std::min(shape.keyframes, slots + slots / 4 + kPlacesBetweenMoves));
  front_stride_ = fixed_ + places_ * kPose + kZeros;
  GrowTo(static_cast<std::size_t>(front_stride_) *
             (fixed_ + places_ * kPose + kPanelPad),
         &front_);
  // Clears only the fixed part: poses are cleared as they enter.
  for (int j = 0; j < fixed_; ++j) Zero(&Front(0, j), fixed_ + kPanelPad);
  panel_stride_ = fixed_ + WholeVectors(slots * kPose) + kZeros;
  for (auto* panel : {&coupling_, &substituted_, &product_, &half_}) {
    GrowTo(static_cast<std::size_t>(kTileState) * panel_stride_, panel);
  }
  GrowTo(static_cast<std::size_t>(fixed_ + kPose + kPanelPad) * kLinkColumns,
         &link_terms_);

  keyframe_stride_ = kPose + landmark_shared_ + 1;
  const std::size_t sums =
      static_cast<std::size_t>(shape.keyframes) * kPose * keyframe_stride_;
  keyframe_sums_.assign(sums, 0);
  shared_sums_.assign((landmark_shared_ + 1) * (landmark_shared_ + 1), 0);
}

void ChainElimination::Start(const ChainShape& shape, Record record) {
  structure_.Find(shape.keyframes, shape.tracks, shape.track_keyframes);
  LayOut(shape);
  FindViews(shape);
  record_ = record;
  steps_.clear();
  products_.clear();
  if (record == Record::kSteps) ReserveSteps();
  first_place_ = 0;
  slots_ = 0;
  current_ = 0;
  begun_ = false;
}

void ChainElimination::TakeScratch(ChainElimination* finished) {
  for (const auto buffer : {&ChainElimination::front_,
                            &ChainElimination::group_panels_,
                            &ChainElimination::own_poses_,
                            &ChainElimination::gram_,
                            &ChainElimination::keyframe_sums_,
                            &ChainElimination::coupling_,
                            &ChainElimination::substituted_,
                            &ChainElimination::product_,
                            &ChainElimination::half_,
                            &ChainElimination::link_terms_}) {
    (this->*buffer).swap(finished->*buffer);
  }
  targets_.swap(finished->targets_);
}

void ChainElimination::OpenSlots(int slots) {
  if (first_place_ + slots > places_) {
    // All poses are moved to the first places; every entry moves up or left, so
    // that ascending order never overwrites entries that are still to be read.
    const int from = Pose(0), to = fixed_, size = PosesSize();
    for (int j = 0; j < fixed_; ++j) {
      std::memmove(&Front(to, j), &Front(from, j), size * sizeof(double));
    }
    for (int j = 0; j < size; ++j) {
      std::memmove(&Front(to + j, to + j),
                   &Front(from + j, from + j),
                   (size - j) * sizeof(double));
    }
    first_place_ = 0;
  }
  for (; slots_ < slots; ++slots_) {
    const int row = Pose(slots_);
    const auto clear = [&](int column) {
      double* entries = &Front(row, column);
      for (int i = 0; i < kPose; ++i) entries[i] = 0;
    };
    for (int j = 0; j < fixed_; ++j) clear(j);
    for (int j = Pose(0); j < row + kPose; ++j) clear(j);
  }
}

// Swaps the poses in `slot` and in slot 1.
void ChainElimination::SwapPoses(int slot) {
  if (slot == 1) return;
  const auto entry = [&](int i, int j) -> double& {
    return i >= j ? Front(i, j) : Front(j, i);
  };
  const int a = Pose(1), b = Pose(slot), end = Pose(slots_);
  for (int n = 0; n < kPose; ++n) {
    // The rest of the front, except the two blocks themselves.
    for (int j = 0; j < end; ++j) {
      if (j >= fixed_ && j < Pose(0)) continue;
      if ((j >= a && j < a + kPose) || (j >= b && j < b + kPose)) continue;
      std::swap(entry(a + n, j), entry(b + n, j));
    }
    for (int j = 0; j <= n; ++j)
      std::swap(Front(a + n, a + j), Front(b + n, b + j));
    for (int j = 0; j < n; ++j)
      std::swap(Front(b + n, a + j), Front(b + j, a + n));
  }
}

void ChainElimination::BeginKeyframe() {
  if (begun_) return;
  begun_ = true;
  OpenSlots(static_cast<int>(structure_.Poses(current_).size()));
  const int pose = Pose(0);
  for (int i = 0; i < kPose; ++i) {
    const double* row =
        &keyframe_sums_[(current_ * kPose + i) * keyframe_stride_];
    for (int j = 0; j <= i; ++j) Front(pose + i, pose + j) += row[j];
    for (int c = 0; c <= landmark_shared_; ++c) {
      Front(pose + i, landmark_place_ + c) += row[kPose + c];
    }
  }
  EliminateLandmarks();
  SwapPoses(structure_.SwapWithNext(current_));
}

void ChainElimination::AddPrior(const ChainStateMatrix& information) {
  BeginKeyframe();
  const int pose = Pose(0);
  for (int i = 0; i < kPose; ++i) {
    for (int j = 0; j <= i; ++j) Front(pose + i, pose + j) += information(i, j);
    for (int j = 0; j < kMotion; ++j) {
      Front(pose + i, kMotionPlace + j) += information(i, kPose + j);
    }
  }
  for (int i = 0; i < kMotion; ++i) {
    for (int j = 0; j <= i; ++j) {
      Front(kMotionPlace + i, kMotionPlace + j) +=
          information(kPose + i, kPose + j);
    }
  }
}

void ChainElimination::AddKeptBias(int kept, const KeptBiasRows& rows) {
  BeginKeyframe();
  for (int m = 0; m < rows.residual.size(); ++m) {
    const int bias = kMotionPlace + 3 + m;
    const int place = kKeptPlace + kept + m;
    const double a = rows.by_bias[m], b = rows.by_kept[m];
    Front(bias, bias) += a * a;
    Front(place, bias) += a * b;
    Front(place, place) += b * b;
    Front(constant_, bias) += a * rows.residual[m];
    Front(constant_, place) += b * rows.residual[m];
  }
}

void ChainElimination::AddKeptState(int kept,
                                    const ChainStateVector& information) {
  BeginKeyframe();
  for (int m = 0; m < kState; ++m) {
    const int state = m < kPose ? Pose(0) + m : kMotionPlace + m - kPose;
    const int place = kKeptPlace + kept + m;
    Front(state, state) += information[m];
    Front(place, place) += information[m];
    Front(std::max(state, place), std::min(state, place)) -= information[m];
  }
}

void ChainElimination::Advance(const ChainTransition& link) {
  BeginKeyframe();
  TakeState();
  Substitute(link);
  FindRootOf(link);
  Eliminate(substituted_);
  AddPosesWithFixed(link);
  RecordStep(&link);
  ++current_;
  begun_ = false;
}

int ChainElimination::Place(int shared) const {
  if (shared < kChainLinkShared) return shared;
  const int landmark = shared - kChainLinkShared;
  return landmark < landmark_shared_ ? landmark_place_ + landmark
                                     : kKeptPlace + landmark - landmark_shared_;
}

void ChainElimination::Finish(SharedInformation* result) {
  BeginKeyframe();
  TakeState();
  EliminateByItself();
  // The products among camera parameters were summed separately.
  const int rows = landmark_shared_ + 1;
  for (int j = 0; j < landmark_shared_; ++j) {
    for (int i = j; i < rows; ++i) {
      Front(landmark_place_ + i, landmark_place_ + j) +=
          shared_sums_[j * rows + i];
    }
  }
  const int size = shared_size();
  result->Lambda.resize(size, size);
  result->eta.resize(size);
  result->constant = Front(constant_, constant_);
  for (int j = 0; j < size; ++j) {
    for (int i = j; i < size; ++i) {
      const int a = Place(i), b = Place(j);
      const double information = Front(std::max(a, b), std::min(a, b));
      result->Lambda(i, j) = information;
      result->Lambda(j, i) = information;
    }
    result->eta(j) = -Front(constant_, Place(j));
  }
}

}  // namespace selfcal
