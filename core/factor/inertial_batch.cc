#include "core/factor/inertial_batch.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <optional>

#include "core/factor/inertial_kernel.h"
#include "core/factor/preintegration_readings.h"
#include "core/factor/sampling.h"

namespace selfcal {
namespace {

using inertial::kDensities;
using inertial::KernelInput;
using inertial::kReadingSize;

template <int W>
void SetState(const KeyframeState& x,
              int lane,
              double (&numbers)[inertial::kStateNumbers][W]) {
  Eigen::Matrix<double, inertial::kStateNumbers, 1> all;
  all << x.q_GI.coeffs(), x.p_GI, x.v_GI, x.b_a, x.b_g;
  for (int i = 0; i < all.size(); ++i) numbers[i][lane] = all[i];
}

// Items first .. first + n for W lanes. The other lanes read the last of them,
// and write to an unused one.
template <int W, typename Item>
std::array<const Item*, W> Inputs(std::span<const Item> items,
                                  std::size_t first,
                                  std::size_t n) {
  std::array<const Item*, W> lanes;
  for (std::size_t lane = 0; lane < W; ++lane) {
    lanes[lane] = &items[first + std::min(lane, n - 1)];
  }
  return lanes;
}

template <int W, typename Item>
std::array<Item*, W> Outputs(std::span<Item> items,
                             std::size_t first,
                             std::size_t n,
                             Item* unused) {
  std::array<Item*, W> lanes;
  for (std::size_t lane = 0; lane < W; ++lane) {
    lanes[lane] = lane < n ? &items[first + lane] : unused;
  }
  return lanes;
}

}  // namespace

void InertialTransitions::Start(std::size_t count, int link_size) {
  columns_ = TransitionColumns(link_size);
  count_ = count;
  numbers_.GrowTo(count * Stride());
}

template <int W>
std::array<inertial::TransitionTarget, W> InertialBatch::Targets(
    std::size_t first, std::size_t n, InertialTransitions* out) {
  unused_transition_.Start(1, out->columns_.link_size);
  std::array<inertial::TransitionTarget, W> lanes;
  for (std::size_t lane = 0; lane < W; ++lane) {
    InertialTransitions* to = lane < n ? out : &unused_transition_;
    double* G =
        to->numbers_.data() + (lane < n ? first + lane : 0) * to->Stride();
    double* A = G + to->GSize();
    lanes[lane] = {G, A, A + InertialTransitions::kASize};
  }
  return lanes;
}

template <int W>
int InertialBatch::GatherReadings(std::span<const InertialLinkStates> links,
                                  const ImuNoise* noise) {
  const auto row = [](AlignedNumbers* numbers, int size, int index) {
    const std::size_t end = (static_cast<std::size_t>(index) + 1) * size * W;
    numbers->GrowTo(end);
    return numbers->data() + (end - size * W);
  };
  const auto reading = [&](int index) {
    return row(&readings_, kReadingSize, index);
  };
  const auto density = [&](int index) {
    return row(&densities_, kDensities, index);
  };
  int counts[W];
  for (int lane = 0; lane < W; ++lane) {
    const InertialLinkStates& link = links[lane];
    const std::int64_t t0_ns = link.x0->t_ns, t1_ns = link.x1->t_ns;
    std::optional<Sampling> sampling;
    if (noise != nullptr) {
      sampling.emplace(link.samples, t0_ns, t1_ns, *noise);
    }
    int count = 0;
    const auto add = [&](const ImuSample& sample, double h, std::size_t next) {
      double* to = reading(count) + lane;
      to[0] = h;
      for (int i = 0; i < 3; ++i) {
        to[(1 + i) * W] = sample.gyro[i];
        to[(4 + i) * W] = sample.accel[i];
      }
      if (sampling) {
        const StepDensities of_step = sampling->At(next);
        double* noise_to = density(count) + lane;
        noise_to[0] = of_step.gyro;
        noise_to[W] = of_step.accel;
      }
      ++count;
    };
    preintegration::VisitReadings(link.samples, t0_ns, t1_ns, add);
    counts[lane] = count;
  }
  const int rows = *std::max_element(counts, counts + W);
  // Pads shorter links with steps of length zero.
  for (int lane = 0; lane < W; ++lane) {
    const double* last = reading(counts[lane] - 1) + lane;
    for (int i = counts[lane]; i < rows; ++i) {
      double* to = reading(i) + lane;
      to[0] = 0;
      for (int k = 1; k < kReadingSize; ++k) to[k * W] = last[k * W];
      if (noise == nullptr) continue;
      for (int k = 0; k < kDensities; ++k) density(i)[k * W + lane] = 0;
    }
  }
  return rows;
}

template <class Function>
void InertialBatch::ForEachGroup(std::span<const InertialLinkStates> links,
                                 const ImuCalibration& imu,
                                 const ImuNoise* noise,
                                 double gravity_mps2,
                                 const Function& run) {
  WithLanes(width_, [&]<int W>() {
    KernelInput<W> input;
    input.imu = CorrectionOf(imu);
    input.coupled = IsCoupled(imu);
    input.columns = TransitionColumns(ImuTangentSize(imu));
    input.gravity_mps2 = gravity_mps2;
    for (std::size_t first = 0; first < links.size(); first += W) {
      const std::size_t count = std::min<std::size_t>(W, links.size() - first);
      // Lanes without a link repeat the last one.
      InertialLinkStates group[W];
      for (std::size_t lane = 0; lane < W; ++lane) {
        const InertialLinkStates& link =
            links[first + std::min(lane, count - 1)];
        group[lane] = link;
        SetState<W>(*link.x0, lane, input.x0);
        SetState<W>(*link.x1, lane, input.x1);
        input.dt_s[lane] = static_cast<double>(link.x1->t_ns - link.x0->t_ns) *
                           preintegration::kSecondsPerNanosecond;
      }
      input.rows = GatherReadings<W>(group, noise);
      input.readings = readings_.data();
      input.densities = densities_.data();
      run.template operator()<W>(input, first, count);
    }
  });
}

void InertialBatch::Linearise(std::span<const InertialLinkStates> links,
                              const ImuCalibration& imu,
                              const ImuNoise& noise,
                              double gravity_mps2,
                              std::span<InertialNoiseRoot> roots,
                              InertialTransitions* out) {
  assert(roots.size() == links.size());
  out->Start(links.size(), ImuTangentSize(imu));
  ForEachGroup(
      links,
      imu,
      &noise,
      gravity_mps2,
      [&]<int W>(
          const KernelInput<W>& input, std::size_t first, std::size_t n) {
        inertial::LineariseLinks<W>(
            input,
            noise,
            Outputs<W>(roots, first, n, &unused_root_).data(),
            Targets<W>(first, n, out).data());
      });
}

void InertialBatch::LineariseWithRoots(
    std::span<const InertialLinkStates> links,
    const ImuCalibration& imu,
    double gravity_mps2,
    std::span<const InertialNoiseRoot> roots,
    InertialTransitions* out) {
  assert(roots.size() == links.size());
  out->Start(links.size(), ImuTangentSize(imu));
  ForEachGroup(
      links,
      imu,
      nullptr,
      gravity_mps2,
      [&]<int W>(
          const KernelInput<W>& input, std::size_t first, std::size_t n) {
        inertial::LineariseLinksWithRoots<W>(input,
                                             Inputs<W>(roots, first, n).data(),
                                             Targets<W>(first, n, out).data());
      });
}

void InertialBatch::Residuals(std::span<const InertialLinkStates> links,
                              const ImuCalibration& imu,
                              double gravity_mps2,
                              std::span<const InertialNoiseRoot> roots,
                              std::span<InertialResidual> whitened) {
  assert(roots.size() == links.size() && whitened.size() == links.size());
  double unused[kChainStateSize];
  ForEachGroup(
      links,
      imu,
      nullptr,
      gravity_mps2,
      [&]<int W>(
          const KernelInput<W>& input, std::size_t first, std::size_t n) {
        double* to[W];
        for (std::size_t lane = 0; lane < W; ++lane) {
          to[lane] = lane < n ? whitened[first + lane].data() : unused;
        }
        inertial::WhitenedResiduals<W>(
            input, Inputs<W>(roots, first, n).data(), to);
      });
}

}  // namespace selfcal
