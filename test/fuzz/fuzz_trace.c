// SPDX-License-Identifier: BSD-3-Clause
// Fuzz entry (libFuzzer, `make fuzz`): any bytes as a recording. By the first byte they are the
// file as it is (plain or gzip), or text that is packed here first, whole or cut. What is
// accepted must play to its end, in order.
#include <zlib.h>

#include "bytes.h"
#include "gloved/drivers.h"
#include "gloved/fcu.h"

enum { PACKED_MAX = 1 << 20, MOST_FRAMES = 1 << 20 };
enum { AS_IT_IS, PACKED, PACKED_AND_CUT, KINDS };

static size_t pack(const uint8_t *data, size_t size, uint8_t *out) {
  z_stream stream;
  memset(&stream, 0, sizeof stream);
  REQUIRE(deflateInit2(&stream, 1, Z_DEFLATED, 15 + 16, 8, Z_DEFAULT_STRATEGY) == Z_OK);
  uint8_t *in = malloc(size + 1);
  memcpy(in, data, size);
  stream.next_in = in;
  stream.avail_in = (unsigned)size;
  stream.next_out = out;
  stream.avail_out = PACKED_MAX;
  REQUIRE(deflate(&stream, Z_FINISH) == Z_STREAM_END);
  const size_t packed = stream.total_out;
  deflateEnd(&stream);
  free(in);
  return packed;
}

static void play(gv_driver *trace) {
  gv_frame frame[64];
  int64_t last_ns = 0;
  uint64_t frames = 0;
  int count;
  while ((count = trace->poll(trace->self, INT64_MAX, frame, 64)) > 0) {
    for (int i = 0; i < count; i++) {
      REQUIRE(frame[i].stamp_ns >= last_ns && frame[i].len <= 64 && frame[i].id != GV_ID_FORCE_COMMAND);
      last_ns = frame[i].stamp_ns;
    }
    frames += (uint64_t)count;
    REQUIRE(frames < MOST_FRAMES);
  }
  REQUIRE(frames > 0 && trace->ended(trace->self));
  REQUIRE(last_ns <= gv_trace_length_ns(trace));
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
  static uint8_t packed[PACKED_MAX];
  if (size < 2)
    return 0;
  const int kind = data[0] % KINDS;
  const unsigned cut = data[1];
  data += 2;
  size -= 2;
  if (kind != AS_IT_IS) {
    size = pack(data, size, packed);
    if (kind == PACKED_AND_CUT)
      size = size * cut / 256;
    data = packed;
  }
  gv_driver trace;
  char err[512] = "";
  const fuzz_file file = fuzz_file_open(data, size);
  if (gv_trace_open(file.path, &trace, err, sizeof err) == 0) {
    play(&trace);
    trace.close(trace.self);
  } else {
    fuzz_require_reason(err, file.path);
  }
  fuzz_file_close(&file);
  return 0;
}
