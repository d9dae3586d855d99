// SPDX-License-Identifier: BSD-3-Clause
// What somebody outside may ask of a running daemon (channel GLOVED_COMMAND), and the bounds of it. Nothing
// here arms: a person does that at the device.
#ifndef GLOVED_PROCESS_REQUEST_H
#define GLOVED_PROCESS_REQUEST_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef enum gv_request_kind {  // as in data/lcm/gloved_command_t.lcm
  GV_REQUEST_RESET,             // objects back to their start; refused while a force may flow
  GV_REQUEST_SCENE,             // text: file of the scene, below the daemon's directory; refused while a
                                // force may flow
  GV_REQUEST_COUPLING,          // value: stiffness as a multiple of the configured one; damping by its root
  GV_REQUEST_FRICTION,          // value: mu of the hand's skin
  GV_REQUEST_START_LOG,         // text: name of a new file in the daemon's directory
  GV_REQUEST_STOP_LOG,
  GV_REQUEST_DISARM,  // no force until the dead-man switch was let go and pressed again
  GV_REQUEST_TRACE,   // value: 1 publish GLOVED_TRACE, 0 do not
  GV_REQUEST_STATUS,  // text: name of a value that is in force, empty: all of them; changes nothing
  GV_REQUEST_KINDS
} gv_request_kind;

enum {
  GV_REQUEST_TEXT = 200,      // bytes of a file name with its final zero
  GV_REQUEST_WHY = 400,       // bytes of a refusal
  GV_REQUEST_PER_SECOND = 10  // more are refused
};
#define GV_REQUEST_COUPLING_MIN 0.1
#define GV_REQUEST_COUPLING_MAX 2.0
#define GV_REQUEST_FRICTION_MAX 2.0

typedef struct gv_request {
  gv_request_kind kind;
  double value;
  char text[GV_REQUEST_TEXT];
  int64_t tag;  // of the sender; comes back in the answer
} gv_request;

// How many requests came in the second that began at second_ns.
typedef struct gv_request_rate {
  int64_t second_ns;
  int count;
} gv_request_rate;

// A request as it came, before anybody looked at it.
typedef struct gv_request_message {
  int kind;
  double value;
  const char *text;
  int64_t tag;
} gv_request_message;

// True where the request is sound and not too frequent; else out_why says what is wrong with which value,
// and what to do. now_ns: a clock that runs on.
bool gv_request_check(const gv_request_message *message, gv_request_rate *rate, int64_t now_ns,
                      gv_request *out, char out_why[GV_REQUEST_WHY]);
// Whether a message that is no command may be answered now: ten times a second.
bool gv_request_may_complain(gv_request_rate *rate, int64_t now_ns);
// "reset", "scene", ...; "?" beyond the range.
const char *gv_request_name(int kind);

#endif
