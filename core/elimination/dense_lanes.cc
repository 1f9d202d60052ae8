#include "core/elimination/dense_lanes.h"

#include "core/elimination/landmark_rows.h"
#include "core/elimination/small_cholesky.h"
#include "core/simd/lanes.h"

namespace selfcal {
namespace {

constexpr int kLanes = SELFCAL_LANES;
using T = Lanes<kLanes>;

// Rows of a tile in vectors, and its columns: with these sums, rows and one
// factor, a tile uses 16 registers.
constexpr int kTileVectors = 3;
constexpr int kTileColumns = 4;

// Operation on a sum: it is written (kSet), or added with a sign.
constexpr double kSet = 0;

// One tile of V vectors by N columns.
template <int V, int N>
inline void AddTile(double sign,
                    const double* a,
                    int a_stride,
                    const double* b,
                    int b_stride,
                    int depth,
                    double* to,
                    int to_stride) {
  T sums[N][V];
  for (int n = 0; n < N; ++n) {
    for (int v = 0; v < V; ++v) sums[n][v] = 0.0;
  }
  for (int k = 0; k < depth; ++k) {
    T rows[V];
    for (int v = 0; v < V; ++v) rows[v] = Load<kLanes>(a + v * kLanes);
    for (int n = 0; n < N; ++n) {
      const T factor = b[n];
      for (int v = 0; v < V; ++v) sums[n][v] += rows[v] * factor;
    }
    a += a_stride;
    b += b_stride;
  }
  const T signs = sign;
  for (int n = 0; n < N; ++n) {
    for (int v = 0; v < V; ++v) {
      double* place = to + n * to_stride + v * kLanes;
      Store(
          sign == kSet ? sums[n][v] : Load<kLanes>(place) + signs * sums[n][v],
          place);
    }
  }
}

// N columns from `column` on, for the rows from `begin` on.
template <int N>
inline void AddColumns(double sign,
                       ConstPanel a,
                       int begin,
                       int end,
                       Depth depth,
                       ConstPanel b,
                       int column,
                       Target to) {
  const double* factors = b.data + column;
  double* place = to.data + column * to.stride;
  for (int i = begin; i < end;) {
    const int d =
        depth.by_step == nullptr ? depth.all : depth.by_step[i / depth.step];
    const int vectors = (end - i + kLanes - 1) / kLanes;
    const auto tile = [&]<int V>() {
      AddTile<V, N>(sign,
                    a.data + i,
                    a.stride,
                    factors,
                    b.stride,
                    d,
                    place + i,
                    to.stride);
      i += V * kLanes;
    };
    if (d == 0) return;  // as for all following rows
    if (vectors >= kTileVectors) {
      tile.template operator()<kTileVectors>();
    } else if (vectors == 2) {
      tile.template operator()<2>();
    } else {
      tile.template operator()<1>();
    }
  }
}

}  // namespace

template <int W>
void DenseLanes<W>::SetProduct(
    ConstPanel a, int rows, ConstPanel b, int columns, Depth depth, Target to) {
  AddProduct(kSet, a, rows, b, columns, depth, to);
}

template <int W>
void DenseLanes<W>::AddProduct(double sign,
                               ConstPanel a,
                               int rows,
                               ConstPanel b,
                               int columns,
                               Depth depth,
                               Target to) {
  int column = 0;
  for (; column + kTileColumns <= columns; column += kTileColumns) {
    AddColumns<kTileColumns>(sign, a, 0, rows, depth, b, column, to);
  }
  for (; column < columns; ++column) {
    AddColumns<1>(sign, a, 0, rows, depth, b, column, to);
  }
}

// Starts with the rows of the vector that contains the diagonal. The columns
// that fill the last tile are zeros as well.
template <int W>
void DenseLanes<W>::AddSquare(
    double sign, ConstPanel a, int size, Depth depth, Target to) {
  for (int column = 0; column < size; column += kTileColumns) {
    AddColumns<kTileColumns>(
        sign, a, column / kLanes * kLanes, size, depth, a, column, to);
  }
}

template <int W>
void DenseLanes<W>::AddLandmarkProducts(const double* rows,
                                        int stride,
                                        int count,
                                        const LandmarkTarget* targets) {
  for (int i = 0; i < count; ++i) {
    const double* x = rows + 2 * i * stride;
    const double* y = x + stride;
    const LandmarkTarget& to = targets[i];
    for (int j = 0; j < 3; ++j) {
      const T by_x = -x[kRowsPosition + j];
      const T by_y = -y[kRowsPosition + j];
      double* sums = to.sums + j * stride;
      double* poses = to.poses + j * to.pose_stride;
      for (int c = 0; c < stride; c += W) {
        const T product = by_x * Load<W>(x + c) + by_y * Load<W>(y + c);
        Store(Load<W>(sums + c) + product, sums + c);
        if (c + W <= kRowsOwn) {
          Store(Load<W>(poses + c) + product, poses + c);
        } else {
          for (int i = 0; c + i < kRowsOwn; ++i) poses[c + i] += product[i];
        }
      }
    }
  }
}

template <int W>
void DenseLanes<W>::FactorAndSolve(int n,
                                   double* matrix,
                                   int stride,
                                   double* panel,
                                   int panel_stride,
                                   int columns) {
  constexpr int kLargest = 24;
  double masses[kLargest];
  for (int j = 0; j < n; ++j) masses[j] = matrix[j * stride + j];
  for (int j = 0; j < n; ++j) {
    double* row = matrix + j * stride;
    const double floor = masses[j] > 0 ? kPivotFloor * masses[j] : 1.0;
    const double pivot = row[j] > floor ? row[j] : floor;
    const double inverse = 1 / __builtin_sqrt(pivot);
    const T scale = inverse;
    const int begin = j / W * W;
    for (int c = begin; c < n; c += W) Store(scale * Load<W>(row + c), row + c);
    row[j] = pivot * inverse;
    double* x = panel + j * panel_stride;
    for (int c = 0; c < columns; c += W) Store(scale * Load<W>(x + c), x + c);
    for (int i = j + 1; i < n; ++i) {
      const T factor = row[i];
      double* other = matrix + i * stride;
      for (int c = i / W * W; c < n; c += W) {
        Store(Load<W>(other + c) - factor * Load<W>(row + c), other + c);
      }
      double* y = panel + i * panel_stride;
      for (int c = 0; c < columns; c += W) {
        Store(Load<W>(y + c) - factor * Load<W>(x + c), y + c);
      }
    }
  }
}

template <int W>
void DenseLanes<W>::SolveThreeRows(const double* L,
                                   double* panel,
                                   int stride,
                                   int n) {
  const T l00 = L[0], l10 = L[1], l11 = L[2], l20 = L[3], l21 = L[4],
          l22 = L[5];
  double* x = panel;
  double* y = panel + stride;
  double* z = panel + 2 * stride;
  for (int i = 0; i < n; i += W) {
    const T a = Load<W>(x + i) * l00;
    const T b = (Load<W>(y + i) - l10 * a) * l11;
    const T c = (Load<W>(z + i) - l20 * a - l21 * b) * l22;
    Store(a, x + i);
    Store(b, y + i);
    Store(c, z + i);
  }
}

template struct DenseLanes<kLanes>;

}  // namespace selfcal
