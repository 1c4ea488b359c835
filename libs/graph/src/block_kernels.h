#pragma once
// Products of blocks of 6 rows (poses in space), in registers of any width; of 3 and 7 as loops: each lane does the
// same operations in the same order, so that processors with wider registers give the same bytes. Blocks lie column by
// column.

// Into loops of MAPWEAVE_WIDE_CLONES (mapweave/core/processor_clones.h).
#define MAPWEAVE_INTO_CLONES __attribute__((always_inline)) inline

namespace mapweave::graph {

using FourLanes = double __attribute__((vector_size(32), aligned(8), may_alias));
using TwoLanes = double __attribute__((vector_size(16), aligned(8), may_alias));

// c -= a * b^T; a, b and c have kRows rows, a and b kInner columns, c kRows.
template <int kRows, int kInner>
MAPWEAVE_INTO_CLONES void subtract_product(const double* a, const double* b, double* c) {
  if constexpr (kRows != 6) {
    for (int j = 0; j < kRows; ++j)
      for (int k = 0; k < kInner; ++k)
        for (int i = 0; i < kRows; ++i) c[kRows * j + i] -= a[kRows * k + i] * b[kRows * k + j];
  } else {
    constexpr int kAtOnce = 3;  // columns of c in registers
    for (int first = 0; first < kRows; first += kAtOnce) {
      FourLanes high[kAtOnce];
      TwoLanes low[kAtOnce];
#pragma GCC unroll 3
      for (int j = 0; j < kAtOnce; ++j) {
        double* const column = c + kRows * (first + j);
        high[j] = *reinterpret_cast<const FourLanes*>(column);
        low[j] = *reinterpret_cast<const TwoLanes*>(column + 4);
      }
#pragma GCC unroll 6
      for (int k = 0; k < kInner; ++k) {
        const FourLanes a_high = *reinterpret_cast<const FourLanes*>(a + kRows * k);
        const TwoLanes a_low = *reinterpret_cast<const TwoLanes*>(a + kRows * k + 4);
#pragma GCC unroll 3
        for (int j = 0; j < kAtOnce; ++j) {
          const double factor = b[kRows * k + first + j];
          high[j] -= a_high * factor;
          low[j] -= a_low * factor;
        }
      }
#pragma GCC unroll 3
      for (int j = 0; j < kAtOnce; ++j) {
        double* const column = c + kRows * (first + j);
        *reinterpret_cast<FourLanes*>(column) = high[j];
        *reinterpret_cast<TwoLanes*>(column + 4) = low[j];
      }
    }
  }
}

// x with x * lower^T = b, in the place of b; of `lower` the lower triangle counts.
template <int kRows>
MAPWEAVE_INTO_CLONES void divide_by_transposed(const double* lower, double* x) {
  if constexpr (kRows != 6) {
    for (int j = 0; j < kRows; ++j) {
      for (int k = 0; k < j; ++k)
        for (int i = 0; i < kRows; ++i) x[kRows * j + i] -= x[kRows * k + i] * lower[kRows * k + j];
      const double scale = 1.0 / lower[kRows * j + j];
      for (int i = 0; i < kRows; ++i) x[kRows * j + i] *= scale;
    }
  } else {
    FourLanes high[kRows];
    TwoLanes low[kRows];
#pragma GCC unroll 6
    for (int j = 0; j < kRows; ++j) {
      high[j] = *reinterpret_cast<const FourLanes*>(x + kRows * j);
      low[j] = *reinterpret_cast<const TwoLanes*>(x + kRows * j + 4);
#pragma GCC unroll 6
      for (int k = 0; k < j; ++k) {
        const double factor = lower[kRows * k + j];
        high[j] -= high[k] * factor;
        low[j] -= low[k] * factor;
      }
      const double scale = 1.0 / lower[kRows * j + j];
      high[j] *= scale;
      low[j] *= scale;
      *reinterpret_cast<FourLanes*>(x + kRows * j) = high[j];
      *reinterpret_cast<TwoLanes*>(x + kRows * j + 4) = low[j];
    }
  }
}

}  // namespace mapweave::graph
