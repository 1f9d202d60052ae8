// Dense kernels of the elimination for one vector width. Internal to
// core/elimination.
//
// A panel is a row-major matrix; sums are over its rows. All sizes are those of
// the valid entries: whole vectors are loaded and stored, so that up to
// kPanelPad further numbers are read and written. What is written there is a
// sum with what was read; a panel must therefore have zeros there, and a target
// room.
#pragma once

namespace selfcal {

inline constexpr int kPanelPad = 8;

struct ConstPanel {
  const double* data;
  int stride;  // from one row to the next
};

// Column-major.
struct Target {
  double* data;
  int stride;  // from one column to the next
};

// Targets of the products of one landmark's factor.
struct LandmarkTarget {
  double* sums;   // 3 rows of the stride of the factors
  double* poses;  // 3 rows of a panel, pose_stride apart
  int pose_stride;
};

// Number of rows of a panel in a sum: for its column i all of them, or those of
// a staircase by_step[i / step], which never increases.
struct Depth {
  // Implicit: mostly it is a number of rows.
  // NOLINTNEXTLINE(google-explicit-constructor)
  Depth(int all) : all(all) {}
  Depth(const int* by_step, int step) : by_step(by_step), step(step) {}

  int all = 0;
  const int* by_step = nullptr;
  int step = 1;
};

template <int W>
struct DenseLanes {
  // to(i, j) = sum_k a(k, i) b(k, j), for i < rows, j < columns, k < depth of
  // i.
  static void SetProduct(ConstPanel a,
                         int rows,
                         ConstPanel b,
                         int columns,
                         Depth depth,
                         Target to);

  // to(i, j) += sign sum_k a(k, i) b(k, j).
  static void AddProduct(double sign,
                         ConstPanel a,
                         int rows,
                         ConstPanel b,
                         int columns,
                         Depth depth,
                         Target to);

  // The same with a = b on and below the diagonal; the entries above are
  // overwritten with arbitrary values.
  static void AddSquare(
      double sign, ConstPanel a, int size, Depth depth, Target to);

  // For each pair of rows x, y (reprojection factors of landmark_rows.h):
  //   product(j, c) = x_l(j) x(c) + y_l(j) y(c),   x_l = -x[kRowsPosition ...],
  // j < 3: it is added to the sums of its target, and its first six columns to
  // the panel of its pose.
  static void AddLandmarkProducts(const double* rows,
                                  int stride,
                                  int count,
                                  const LandmarkTarget* targets);

  // Factors a symmetric matrix of n rows (n <= 24, `stride` apart, whole
  // vectors) as U^T U, with U overwriting its upper triangle, with the
  // safeguard of small_cholesky.h, and overwrites the columns x of a panel of n
  // rows by U^-T x.
  static void FactorAndSolve(int n,
                             double* matrix,
                             int stride,
                             double* panel,
                             int panel_stride,
                             int columns);

  // Overwrites the columns x of a panel of 3 rows by L^-1 x, for L lower
  // triangular (00 10 11 20 21 22), 1 / L_ii on the diagonal.
  static void SolveThreeRows(const double* L, double* panel, int stride, int n);
};

}  // namespace selfcal
