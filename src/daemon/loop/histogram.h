// SPDX-License-Identifier: BSD-3-Clause
// Histogram of durations with fixed memory: log-linear bins, 64 to each power of two, so that a quantile
// is never off by more than 1/64 (1.6 %). One thread adds, any thread may read meanwhile.
#ifndef GLOVED_PROCESS_HISTOGRAM_H
#define GLOVED_PROCESS_HISTOGRAM_H

#include <stdatomic.h>
#include <stdint.h>

enum {
  GV_HISTOGRAM_SUB_BITS = 6,   // 64 bins to each power of two
  GV_HISTOGRAM_MAX_BITS = 36,  // durations of 2^36 ns (69 s) and more share the last bin
  GV_HISTOGRAM_BINS = (GV_HISTOGRAM_MAX_BITS - GV_HISTOGRAM_SUB_BITS + 1) << GV_HISTOGRAM_SUB_BITS
};

typedef struct gv_histogram {
  _Atomic uint64_t count;
  _Atomic int64_t max_ns;  // exact
  _Atomic uint64_t bin[GV_HISTOGRAM_BINS];
} gv_histogram;

typedef struct gv_quantiles {
  double p50_us, p99_us, p999_us, max_us;
} gv_quantiles;

// A negative duration counts as 0. Only one thread may add. Cost: some 5 ns.
void gv_histogram_add(gv_histogram *histogram, int64_t duration_ns);
// The bins that are not empty, four to a power of two, in rising order: upper edge
// and count. Returns how many.
enum { GV_HISTOGRAM_COARSE = (GV_HISTOGRAM_MAX_BITS - GV_HISTOGRAM_SUB_BITS + 1) * 4 };
int gv_histogram_coarse(const gv_histogram *histogram, int64_t out_upper_ns[GV_HISTOGRAM_COARSE],
                        uint64_t out_count[GV_HISTOGRAM_COARSE]);
// The smallest bin's upper edge that at least `fraction` (0..1) of the durations do not pass; at most the
// largest duration; 0 when empty. Cost: some 2 us.
int64_t gv_histogram_quantile_ns(const gv_histogram *histogram, double fraction);
gv_quantiles gv_histogram_quantiles(const gv_histogram *histogram);

#endif
