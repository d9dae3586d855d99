// SPDX-License-Identifier: BSD-3-Clause
// Opening drivers from their URLs, and the codecs of the two containers a frame travels in.
// Opening and closing belong to set-up (they may allocate and block); see frame.h for the rest.
#ifndef GLOVED_DRIVERS_H
#define GLOVED_DRIVERS_H

#include "gloved/frame.h"

// ---- cannelloni v2 over UDP -----------------------------------------------------------------------
enum { GV_CANNELLONI_MAX_BYTES = 1472, GV_CANNELLONI_MAX_FRAMES = 64 };
// Bytes written, or -1 where they do not fit into `size`.
int gv_cannelloni_pack(uint8_t seq, const gv_frame *frame, int count, uint8_t *out, size_t size);
// Frames read, or -1 (wrong version or operation, truncated, length over 64 or no FD length, bytes left over).
// All or nothing: a bad datagram yields no frame.
int gv_cannelloni_unpack(const uint8_t *data, size_t size, uint8_t *out_seq, gv_frame *out, int max);

// "udp://HOST:PORT?listen=PORT". Only datagrams from HOST count (others: `foreign`). On error returns
// negative and writes one line (what, what to do) to err.
int gv_udp_open(const char *url, gv_driver *out, char *err, size_t err_size);

// ---- candump -L text ------------------------------------------------------------------------------
enum { GV_LOG_LINE_MAX = 200 };
// One line "(seconds.micros) iface ID#DATA" or "ID##FLAGS DATA" without its newline. 0, or negative with a
// short reason in err. Unknown trailing words (candump's R/T) are accepted.
int gv_log_parse(const char *line, gv_frame *out, char *err, size_t err_size);
// The line, with newline; returns its length (never over GV_LOG_LINE_MAX).
int gv_log_format(const gv_frame *frame, const char *iface, char out[GV_LOG_LINE_MAX + 1]);

// "trace:FILE", a candump -L log, plain or gzip. The whole file is read and checked on opening (an error
// names file, line, what, what to do). Stamps are made to start at 0; frames that the engine itself sent
// (FORCE_COMMAND) are skipped and kept out of the stream. The clock is whatever now_ns the caller passes.
int gv_trace_open(const char *path, gv_driver *out, char *err, size_t err_size);
// Stamp of the last frame (the recording's length).
int64_t gv_trace_length_ns(const gv_driver *trace);

#endif
