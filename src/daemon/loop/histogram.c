// SPDX-License-Identifier: BSD-3-Clause
// Log-linear histogram of durations: the bin is the exponent and the top 6 bits below the leading one.
// The real-time thread adds with relaxed atomic loads and stores (plain moves on every common machine);
// the slow thread reads at any time and may see a duration counted that its bin does not show yet.
#include "daemon/loop/histogram.h"

#include <assert.h>

_Static_assert(GV_HISTOGRAM_BINS % GV_HISTOGRAM_COARSE == 0, "coarse bins are whole bins");

static int bin_of(uint64_t ns) {
  if (ns >> GV_HISTOGRAM_MAX_BITS)
    return GV_HISTOGRAM_BINS - 1;
  if (ns >> GV_HISTOGRAM_SUB_BITS == 0)
    return (int)ns;
  int shift = 63 - __builtin_clzll(ns) - GV_HISTOGRAM_SUB_BITS;
  return (shift << GV_HISTOGRAM_SUB_BITS) + (int)(ns >> shift);
}

static int64_t upper_edge_ns(int bin) {
  assert(bin >= 0 && bin < GV_HISTOGRAM_BINS);
  int shift = (bin >> GV_HISTOGRAM_SUB_BITS) - 1;
  if (shift <= 0)
    return bin;
  int64_t top = (bin & ((1 << GV_HISTOGRAM_SUB_BITS) - 1)) + (1 << GV_HISTOGRAM_SUB_BITS);
  return ((top + 1) << shift) - 1;
}

static void bump(_Atomic uint64_t *counter) {
  atomic_store_explicit(counter, atomic_load_explicit(counter, memory_order_relaxed) + 1,
                        memory_order_relaxed);
}

void gv_histogram_add(gv_histogram *histogram, int64_t duration_ns) {
  if (duration_ns < 0)
    duration_ns = 0;
  bump(&histogram->bin[bin_of((uint64_t)duration_ns)]);
  bump(&histogram->count);
  if (duration_ns > atomic_load_explicit(&histogram->max_ns, memory_order_relaxed))
    atomic_store_explicit(&histogram->max_ns, duration_ns, memory_order_relaxed);
}

int64_t gv_histogram_quantile_ns(const gv_histogram *histogram, double fraction) {
  assert(fraction >= 0.0 && fraction <= 1.0);
  uint64_t count = atomic_load_explicit(&histogram->count, memory_order_relaxed);
  uint64_t seen = 0;
  int64_t max_ns = atomic_load_explicit(&histogram->max_ns, memory_order_relaxed);
  if (count == 0)
    return 0;
  for (int i = 0; i < GV_HISTOGRAM_BINS - 1; i++) {
    seen += atomic_load_explicit(&histogram->bin[i], memory_order_relaxed);
    if ((double)seen >= fraction * (double)count && seen > 0)
      return upper_edge_ns(i) < max_ns ? upper_edge_ns(i) : max_ns;
  }
  return max_ns;
}

int gv_histogram_coarse(const gv_histogram *histogram, int64_t out_upper_ns[GV_HISTOGRAM_COARSE],
                        uint64_t out_count[GV_HISTOGRAM_COARSE]) {
  enum { MERGED = GV_HISTOGRAM_BINS / GV_HISTOGRAM_COARSE };
  int n = 0;
  for (int first = 0; first < GV_HISTOGRAM_BINS; first += MERGED) {
    uint64_t sum = 0;
    for (int i = first; i < first + MERGED; i++)
      sum += atomic_load_explicit(&histogram->bin[i], memory_order_relaxed);
    if (!sum)
      continue;
    out_upper_ns[n] = upper_edge_ns(first + MERGED - 1);
    out_count[n++] = sum;
  }
  return n;
}

gv_quantiles gv_histogram_quantiles(const gv_histogram *histogram) {
  return (gv_quantiles){(double)gv_histogram_quantile_ns(histogram, 0.5) * 1e-3,
                        (double)gv_histogram_quantile_ns(histogram, 0.99) * 1e-3,
                        (double)gv_histogram_quantile_ns(histogram, 0.999) * 1e-3,
                        (double)atomic_load_explicit(&histogram->max_ns, memory_order_relaxed) * 1e-3};
}
