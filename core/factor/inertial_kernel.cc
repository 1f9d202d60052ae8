#include "core/factor/inertial_kernel.h"

#include "core/factor/inertial_transition.h"
#include "core/factor/preintegration_integrator.h"
#include "core/simd/lanes.h"

namespace selfcal::inertial {
namespace {

using preintegration::Integrator;

template <int W>
Vector3<Lanes<W>> LoadVector(const double* from) {
  return {Load<W>(from), Load<W>(from + W), Load<W>(from + 2 * W)};
}

template <int W>
State<Lanes<W>> LoadState(const double (&x)[kStateNumbers][W]) {
  return {.q_GI = {Load<W>(x[3]), Load<W>(x[0]), Load<W>(x[1]), Load<W>(x[2])},
          .p_GI = LoadVector<W>(x[4]),
          .v_GI = LoadVector<W>(x[7]),
          .b_a = LoadVector<W>(x[10]),
          .b_g = LoadVector<W>(x[13])};
}

// The links, up to the residual. Imu is ImuModel or CoupledImuModel.
template <int W, template <typename> class Imu>
struct Link {
  using T = Lanes<W>;

  Link(const KernelInput<W>& input,
       const ImuNoise& noise,
       const PreintegrationParts& parts)
      : x0(LoadState<W>(input.x0)),
        x1(LoadState<W>(input.x1)),
        dt(Load<W>(input.dt_s)),
        imu(input.imu),
        integrator(imu, noise, parts, Corrected(input.readings)) {
    const double* row = input.readings;
    const double* densities = input.densities;
    for (int i = 1; i < input.rows; ++i) {
      row += kReadingSize * W;
      if (parts.covariance) {
        densities += kDensities * W;
        integrator.Step(Corrected(row),
                        Load<W>(row),
                        Load<W>(densities),
                        Load<W>(densities + W));
      } else {
        integrator.Step(Corrected(row), Load<W>(row));
      }
    }
    if (parts.covariance) integrator.Finish();
    motion = MotionBetween<T>(x0, x1, dt, T(input.gravity_mps2));
    residual = ResidualOf<T>(x0, x1, motion, integrator.motion());
  }

  preintegration::Reading<T> Corrected(const double* row) const {
    return imu.Correct(
        LoadVector<W>(row + W), LoadVector<W>(row + 4 * W), x0.b_g, x0.b_a);
  }

  const State<T> x0, x1;
  const T dt;
  const Imu<T> imu;
  Integrator<T, Imu<T>> integrator;
  StateMotion<T> motion;
  Eigen::Matrix<T, 15, 1> residual;
};

template <int W>
NoiseRoot<Lanes<W>> LoadRoot(const InertialNoiseRoot* const* roots) {
  NoiseRoot<Lanes<W>> root;
  for (int l = 0; l < W; ++l) {
    for (int i = 0; i < 9; ++i) {
      for (int j = i; j < 9; ++j) {
        root.motion(i, j).Set(l, roots[l]->motion[i][j]);
      }
    }
    for (int i = 0; i < 9; ++i) {
      for (int j = 0; j < 6; ++j) {
        root.motion_by_bias(i, j).Set(l, roots[l]->motion_by_bias[i][j]);
      }
    }
    for (int i = 0; i < 6; ++i) root.bias[i].Set(l, roots[l]->bias[i]);
  }
  return root;
}

template <int W>
void StoreRoot(const NoiseRoot<Lanes<W>>& root,
               InertialNoiseRoot* const* roots) {
  for (int l = 0; l < W; ++l) {
    for (int i = 0; i < 9; ++i) {
      for (int j = 0; j < 9; ++j) {
        roots[l]->motion[i][j] = j < i ? 0.0 : root.motion(i, j)[l];
      }
      for (int j = 0; j < 6; ++j) {
        roots[l]->motion_by_bias[i][j] = root.motion_by_bias(i, j)[l];
      }
    }
    for (int i = 0; i < 6; ++i) roots[l]->bias[i] = root.bias[i][l];
  }
}

template <int W, class Link>
NoiseRoot<Lanes<W>> RootOf(const Link& link, const ImuNoise& noise) {
  using T = Lanes<W>;
  NoiseRoot<T> root;
  const Vector3<T> r = link.residual.template segment<3>(kResidualRotation);
  const Matrix3<T> by_psi =
      RightJacobianInverse<T>(-r) * link.integrator.Delta_R().transpose();
  const T root_dt = Sqrt(link.dt);
  for (int i = 0; i < 3; ++i) {
    root.bias[i] = noise.accel_bias_random_walk * root_dt;
    root.bias[3 + i] = noise.gyro_bias_random_walk * root_dt;
  }
  RootOfMotionCovariance(
      link.integrator.covariance(), link.integrator.walk(), by_psi, &root);
  return root;
}

// `rows` are 9 of `columns`, a multiple of W.
template <int W>
void StoreRows(const Lanes<W>* rows, int columns, double* (&to)[W]) {
  for (int i = 0; i < 9 * columns; i += W) {
    StoreTransposed<W>(rows + i, to);
    for (int l = 0; l < W; ++l) to[l] += W;
  }
}

template <int W>
void StoreTransition(const MotionRows<Lanes<W>>& rows,
                     const TransitionColumns& columns,
                     const NoiseRoot<Lanes<W>>& root,
                     const Eigen::Matrix<Lanes<W>, 15, 1>& residual,
                     const TransitionTarget* out) {
  double* G[W];
  double* A[W];
  for (int l = 0; l < W; ++l) {
    G[l] = out[l].G;
    A[l] = out[l].A;
  }
  StoreRows<W>(rows.G, columns.stride, G);
  StoreRows<W>(rows.A[0], kTransitionNoise, A);
  const Eigen::Matrix<Lanes<W>, 15, 1> white = Whiten(root, residual);
  for (int l = 0; l < W; ++l) {
    for (int i = 0; i < 6; ++i) {
      for (int c = 0; c < columns.stride; ++c) G[l][c] = 0;
      for (int c = 0; c < kTransitionNoise; ++c) A[l][c] = 0;
      G[l][columns.link_size + 3 + i] = 1;
      G[l][columns.constant] = residual[kResidualAccelBias + i][l];
      A[l][9 + i] = -root.bias[i][l];
      G[l] += columns.stride;
      A[l] += kTransitionNoise;
    }
    for (int i = 0; i < 15; ++i) out[l].whitened[i] = white[i][l];
  }
}

template <int W, class Link>
void SolveAndStore(const Link& link,
                   const TransitionColumns& columns,
                   const NoiseRoot<Lanes<W>>& root,
                   const TransitionTarget* out) {
  using T = Lanes<W>;
  const TransitionSolver<T> solver(
      link.x0.q_GI.toRotationMatrix(), link.motion, link.dt, link.residual);
  MotionRows<T> rows;
  solver.Solve(link.integrator.Derivatives(), root, columns, &rows);
  StoreTransition<W>(rows, columns, root, link.residual, out);
}

// Calls use(link) for the model of the IMU.
template <int W, class Use>
void WithLink(const KernelInput<W>& input,
              const ImuNoise& noise,
              const PreintegrationParts& parts,
              const Use& use) {
  if (input.coupled) {
    use(Link<W, CoupledImuModel>(input, noise, parts));
  } else {
    use(Link<W, ImuModel>(input, noise, parts));
  }
}

}  // namespace

template <int W>
void LineariseLinks(const KernelInput<W>& input,
                    const ImuNoise& noise,
                    InertialNoiseRoot* const* roots,
                    const TransitionTarget* out) {
  const PreintegrationParts parts = {.jacobians = true, .covariance = true};
  WithLink<W>(input, noise, parts, [&](const auto& link) {
    const NoiseRoot<Lanes<W>> root = RootOf<W>(link, noise);
    StoreRoot<W>(root, roots);
    SolveAndStore<W>(link, input.columns, root, out);
  });
}

template <int W>
void LineariseLinksWithRoots(const KernelInput<W>& input,
                             const InertialNoiseRoot* const* roots,
                             const TransitionTarget* out) {
  const PreintegrationParts parts = {.jacobians = true, .covariance = false};
  WithLink<W>(input, ImuNoise(), parts, [&](const auto& link) {
    SolveAndStore<W>(link, input.columns, LoadRoot<W>(roots), out);
  });
}

template <int W>
void WhitenedResiduals(const KernelInput<W>& input,
                       const InertialNoiseRoot* const* roots,
                       double* const* whitened) {
  const PreintegrationParts parts = {.jacobians = false, .covariance = false};
  WithLink<W>(input, ImuNoise(), parts, [&](const auto& link) {
    const auto white = Whiten(LoadRoot<W>(roots), link.residual);
    for (int l = 0; l < W; ++l) {
      for (int i = 0; i < 15; ++i) whitened[l][i] = white[i][l];
    }
  });
}

using Input = KernelInput<SELFCAL_LANES>;
using Roots = InertialNoiseRoot* const*;
using ConstRoots = const InertialNoiseRoot* const*;
using Transitions = const TransitionTarget*;

template void LineariseLinks<SELFCAL_LANES>(const Input&,
                                            const ImuNoise&,
                                            Roots,
                                            Transitions);
template void LineariseLinksWithRoots<SELFCAL_LANES>(const Input&,
                                                     ConstRoots,
                                                     Transitions);
template void WhitenedResiduals<SELFCAL_LANES>(const Input&,
                                               ConstRoots,
                                               double* const*);

}  // namespace selfcal::inertial
