// W numbers that are computed together: the scalar type with which the
// mathematics of this project is instantiated to use vector units.
//
// A function template over T works on one value with T = double and on W
// independent ones with T = Lanes<W>. A condition on a value is a Mask instead
// of a branch, and Select() chooses between both outcomes for each lane; for
// double, a Mask is a bool. The implementation uses the vector types of the
// compiler; where those are slow, this file, and no other, uses machine
// instructions. Usable as the scalar of Eigen's matrices.
//
// Code that is compiled for wider units than the rest of the program must not
// share inline functions with it: the linker keeps one copy of each, and may
// keep the one that not every machine can run. Everything instantiated there
// has Lanes<W> in its name, with a W that only that translation unit uses.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <utility>

// Inlines everything that a function calls: called separately, the parts of a
// kernel would pass their matrices through memory. With the checks of a
// sanitizer, the compiler would take minutes for that.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define SELFCAL_FLATTEN
#else
#define SELFCAL_FLATTEN [[gnu::flatten]]
#endif

namespace selfcal {

template <typename Number, int W>
struct VectorRegister {
  typedef Number Type __attribute__((vector_size(sizeof(Number) * W)));
};

template <int W>
struct LaneMask {
  using Register = typename VectorRegister<std::int64_t, W>::Type;
  Register bits;  // all or none, for each lane

  friend LaneMask operator&&(LaneMask a, LaneMask b) {
    return {a.bits & b.bits};
  }
  friend LaneMask operator||(LaneMask a, LaneMask b) {
    return {a.bits | b.bits};
  }
  friend LaneMask operator!(LaneMask a) { return {~a.bits}; }
  bool operator[](int lane) const { return bits[lane] != 0; }
};

template <int W>
struct Lanes {
  using Register = typename VectorRegister<double, W>::Type;
  Register v;

  Lanes() = default;
  // The same value in each lane; implicit, so that formulae stay readable.
  // NOLINTNEXTLINE(google-explicit-constructor)
  Lanes(double x) : v(x - Register{}) {}
  explicit Lanes(Register r) : v(r) {}

  double operator[](int lane) const { return v[lane]; }
  void Set(int lane, double x) { v[lane] = x; }

  Lanes& operator+=(Lanes b) { return v += b.v, *this; }
  Lanes& operator-=(Lanes b) { return v -= b.v, *this; }
  Lanes& operator*=(Lanes b) { return v *= b.v, *this; }
  Lanes& operator/=(Lanes b) { return v /= b.v, *this; }
  friend Lanes operator+(Lanes a, Lanes b) { return Lanes(a.v + b.v); }
  friend Lanes operator-(Lanes a, Lanes b) { return Lanes(a.v - b.v); }
  friend Lanes operator*(Lanes a, Lanes b) { return Lanes(a.v * b.v); }
  friend Lanes operator/(Lanes a, Lanes b) { return Lanes(a.v / b.v); }
  friend Lanes operator-(Lanes a) { return Lanes(-a.v); }
  friend LaneMask<W> operator<(Lanes a, Lanes b) { return {a.v < b.v}; }
  friend LaneMask<W> operator<=(Lanes a, Lanes b) { return {a.v <= b.v}; }
  friend LaneMask<W> operator>(Lanes a, Lanes b) { return {a.v > b.v}; }
  friend LaneMask<W> operator>=(Lanes a, Lanes b) { return {a.v >= b.v}; }
};

template <int W>
Lanes<W> Select(LaneMask<W> mask, Lanes<W> if_true, Lanes<W> if_false) {
  return Lanes<W>(mask.bits ? if_true.v : if_false.v);
}

template <int W>
bool All(LaneMask<W> mask) {
#if defined(__AVX512DQ__)
  if constexpr (W == 8) return _mm512_movepi64_mask((__m512i)mask.bits) == 0xff;
#endif
#if defined(__AVX__)
  if constexpr (W == 4) return _mm256_movemask_pd((__m256d)mask.bits) == 0xf;
#endif
  std::int64_t all = -1;
  for (int i = 0; i < W; ++i) all &= mask.bits[i];
  return all != 0;
}

template <int W>
bool Any(LaneMask<W> mask) {
  return !All(!mask);
}

template <int W>
Lanes<W> Sqrt(Lanes<W> x) {
  Lanes<W> root;
  for (int i = 0; i < W; ++i) root.v[i] = __builtin_sqrt(x.v[i]);
  return root;
}

// Loads W consecutive numbers, at any alignment.
template <int W>
Lanes<W> Load(const double* from) {
  Lanes<W> x;
  __builtin_memcpy(&x.v, from, sizeof(x.v));
  return x;
}

template <int W>
void Store(Lanes<W> x, double* to) {
  __builtin_memcpy(to, &x.v, sizeof(x.v));
}

// Swaps the step x step off-diagonal blocks of a and b, for Transpose().
template <int step, int W, int... lanes>
void SwapBlocks(Lanes<W>* a,
                Lanes<W>* b,
                std::integer_sequence<int, lanes...>) {
  const Lanes<W> upper(__builtin_shufflevector(
      a->v, b->v, ((lanes & step) != 0 ? W + lanes - step : lanes)...));
  b->v = __builtin_shufflevector(
      a->v, b->v, ((lanes & step) != 0 ? W + lanes : lanes + step)...);
  *a = upper;
}

// Transposes W vectors from rows to columns.
template <int W, int step = 1>
SELFCAL_FLATTEN void Transpose(Lanes<W>* block) {
  if constexpr (step < W) {
    for (int i = 0; i < W; ++i) {
      if ((i & step) != 0) continue;
      SwapBlocks<step>(
          block + i, block + i + step, std::make_integer_sequence<int, W>());
    }
    Transpose<W, 2 * step>(block);
  }
}

// to[l][i] = rows[i][l], for W rows.
template <int W>
SELFCAL_FLATTEN void StoreTransposed(const Lanes<W>* rows, double* const* to) {
  Lanes<W> block[W];
  for (int i = 0; i < W; ++i) block[i] = rows[i];
  Transpose(block);
  for (int i = 0; i < W; ++i) Store(block[i], to[i]);
}

// Select() for one value.
inline double Select(bool mask, double if_true, double if_false) {
  return mask ? if_true : if_false;
}
inline bool All(bool mask) { return mask; }
inline bool Any(bool mask) { return mask; }
inline double Sqrt(double x) { return std::sqrt(x); }

template <typename T>
T Abs(T x) {
  return Select(x < T(0), -x, x);
}
template <typename T>
T Max(T a, T b) {
  return Select(a < b, b, a);
}
template <typename T>
T Min(T a, T b) {
  return Select(b < a, b, a);
}

// Access to one lane, and a mask from a condition on each lane: for rare cases.
// A double has one lane.
template <int W>
double Lane(Lanes<W> x, int lane) {
  return x.v[lane];
}
inline double Lane(double x, int) { return x; }

template <typename T>
struct LaneTraits {
  static constexpr int kWidth = 1;
  using Mask = bool;
};
template <int W>
struct LaneTraits<Lanes<W>> {
  static constexpr int kWidth = W;
  using Mask = LaneMask<W>;
};

template <typename T, typename Predicate>
typename LaneTraits<T>::Mask AskEachLane(Predicate predicate) {
  if constexpr (LaneTraits<T>::kWidth == 1) {
    return predicate(0);
  } else {
    typename LaneTraits<T>::Mask mask;
    for (int i = 0; i < LaneTraits<T>::kWidth; ++i) {
      mask.bits[i] = predicate(i) ? -1 : 0;
    }
    return mask;
  }
}

// Applies f to each lane separately.
template <typename T, typename Function>
T ForEachLane(T x, Function f) {
  if constexpr (LaneTraits<T>::kWidth == 1) {
    return f(x);
  } else {
    for (int i = 0; i < LaneTraits<T>::kWidth; ++i) x.v[i] = f(x.v[i]);
    return x;
  }
}

}  // namespace selfcal

namespace Eigen {

template <int W>
struct NumTraits<selfcal::Lanes<W>> : GenericNumTraits<double> {
  using Real = selfcal::Lanes<W>;
  using NonInteger = selfcal::Lanes<W>;
  using Literal = selfcal::Lanes<W>;
  using Nested = selfcal::Lanes<W>;
  enum {
    IsComplex = 0,
    IsInteger = 0,
    IsSigned = 1,
    RequireInitialization = 0,
    ReadCost = 1,
    AddCost = 1,
    MulCost = 1
  };
};

}  // namespace Eigen
