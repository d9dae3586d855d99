// SPDX-License-Identifier: BSD-3-Clause
// Opening drivers from their URLs, and the codecs of the two containers a frame travels in.
// Opening and closing belong to set-up (they may allocate and block); see frame.h for the rest.
#ifndef GLOVED_DRIVERS_H
#define GLOVED_DRIVERS_H

#include "gloved/frame.h"
#include "gloved/hand.h"

#ifdef __cplusplus
extern "C" {
#endif

// ---- before anything is opened --------------------------------------------------------------------
// Opens descriptors 0 to 2 onto /dev/null where the program was started without them, so that no device gets
// the number that standard output is written to. First call in main.
void gv_keep_standard_files(void);
// While the loop runs: what a terminal, pipe or socket has no room for is lost, so that commands, states and
// the end of the program never wait for a reader. Regular files are as they were.
void gv_unblock_standard_files(void);
// After it, for the summary: whoever reads within wait_ms gets all of it again.
void gv_block_standard_files(int wait_ms);

// ---- what comes with the programs -----------------------------------------------------------------
// The file that a user means by `path`: itself where it is there; else "data/REST" or a bare name in the
// folder `kind` ("scenes", "scripts"), with or without `ending` (".scene"), of $GLOVED_DATA, of
// ../share/gloved beside the program, or of the clone that it was built in. True: out is a file that exists;
// false: out is `path`, for the error that names it.
bool gv_data_path(const char *path, const char *kind, const char *ending, char *out, size_t size);

// ---- cannelloni v2 over UDP -----------------------------------------------------------------------
// What we send: one Ethernet datagram; at 5 bytes for an empty frame it never holds more than 293 frames.
// What we take: up to an interface's MTU of 9000 (cannelloni -m 9000), 28 bytes of it for IPv4 and UDP.
enum { GV_CANNELLONI_MAX_BYTES = 1472, GV_CANNELLONI_MAX_FRAMES = 293 };
enum { GV_CANNELLONI_TAKEN_BYTES = 8972, GV_CANNELLONI_TAKEN_FRAMES = 1793 };
// Bytes written, or -1 where they do not fit into `size` or a frame is none
// (identifier or length out of range).
int gv_cannelloni_pack(uint8_t seq, const gv_frame *frame, int count, uint8_t *out, size_t size);
// Frames read, or -1 (wrong version or operation, truncated, length over 64 or no FD length, bytes left
// over). All or nothing: a bad datagram yields no frame.
int gv_cannelloni_unpack(const uint8_t *data, size_t size, uint8_t *out_seq, gv_frame *out, int max);

// "udp://HOST:PORT?listen=PORT", HOST a name or an address ("[::1]" for IPv6). Only datagrams from HOST:PORT
// count (others: `foreign`). A HOST on the loopback is heard on the loopback alone. Stamps and the now_ns of
// poll are CLOCK_MONOTONIC; a frame's stamp is when the kernel received it, never after now_ns. On error
// returns negative and writes one line (what, what to do) to err. `lost` counts datagrams missing in the
// peer's sequence; a peer that starts anew (silence over 250 ms, or sequence 0 after a gap over 16) counts as
// no loss, one that steps back (doubled or swapped on the way) neither.
// Cost: a poll with one datagram 1.6 us, an empty one 0.6 us, a send 3.7 us (one system call each).
int gv_udp_open(const char *url, gv_driver *out, char *err, size_t err_size);

// ---- SocketCAN ------------------------------------------------------------------------------------
// "can:IFACE". CAN FD where the interface's MTU is that of CAN FD (72); on a classic interface the
// messages travel as fcu.h says, and one line about the rates that fit is left in err, which is empty
// otherwise. Only our identifiers pass the kernel's filter. An interface that is down is no error; one
// that does not exist when opening is. One that goes down is used again when it is up; one that is
// removed, or comes back with another MTU, gets a new socket from a thread of the driver's own that looks
// 20 times a second, so that poll and send never wait. `lost` counts frames that the full socket buffer
// dropped (SO_RXQ_OVFL; the kernel tells with the next frame). A queue that is full (ENOBUFS) drops what
// was to be sent, as `tx_failed`: the next period's command is worth more. Stamps as for UDP. On error
// negative, with one line (what, what to do) in err. Cost: one system call a poll while nothing or less
// than 32 frames wait, one for each frame that is sent.
int gv_can_open(const char *url, gv_driver *out, char *err, size_t err_size);

// ---- candump -L text ------------------------------------------------------------------------------
enum { GV_LOG_LINE_MAX = 200, GV_LOG_IFACE = 16 };
// One line "(seconds.micros) iface ID#DATA" or "ID##FLAGS DATA" without its newline. 0, or negative with a
// short reason in err. Unknown trailing words (candump's R/T) are accepted.
int gv_log_parse(const char *line, gv_frame *out, char *err, size_t err_size);
// The line, with newline; returns its length (never over GV_LOG_LINE_MAX).
int gv_log_format(const gv_frame *frame, const char *iface, char out[GV_LOG_LINE_MAX + 1]);

// A log file line by line, plain or gzip, set-up and tools only. Empty lines and lines
// that open with '#' are skipped.
typedef struct gv_log {
  void *file;          // zlib's
  const char *path;    // the caller's; used in messages
  uint64_t line;       // of the frame read last, from 1
  uint64_t late;       // stamps up to 10 ms before their predecessor's (several interfaces): the
                       // larger one is used
  uint64_t truncated;  // 1: the last line, or the gzip stream, broke off (a crash while recording);
                       // it was left out
  int64_t last_ns;
  char iface[GV_LOG_IFACE];  // of the frame read last; longer names are cut
} gv_log;
// Both: negative with one line "FILE:LINE: what; what to do" in err.
int gv_log_open(gv_log *log, const char *path, char *err, size_t err_size);
// 1 a frame, 0 the end.
int gv_log_next(gv_log *log, gv_frame *out, char *err, size_t err_size);
void gv_log_close(gv_log *log);

// "FILE[?iface=NAME]", a candump -L log, plain or gzip; with iface the frames of that interface alone, on the
// clock of the whole log (a recording of two hands has two). The whole file is read and checked on opening
// (an error names file, line, what, what to do; a file without a GLOVE frame is refused). Stamps are made to
// start at 0 with the first line and the recording ends with the last but for commands behind which there is
// no step (gloved/fcu.h); frames that the engine itself sent (FORCE_COMMAND) are kept out of the stream,
// frames of classic CAN joined. The clock is whatever now_ns the caller passes. A last line that broke off
// counts as `bad`. What is sent counts as `tx` and goes nowhere.
int gv_trace_open(const char *url, gv_driver *out, char *err, size_t err_size);
// Stamp of the last line (the recording's length); -1: this driver is no recording alone.
int64_t gv_trace_length_ns(const gv_driver *trace);

// ---- simulated device -----------------------------------------------------------------------------
// "sim:[SCRIPT][?device=best|real&seed=N&NAME=VALUE...]": the model of sim.h in the process. SCRIPT defaults
// to data/scripts/power_box.user, NAME is a member of gv_sim_device. Its time starts at 0 with the first
// poll, the script with it. On error returns negative and writes one line (what, what to do) to err.
int gv_sim_open(const char *url, gv_driver *out, char *err, size_t err_size);

// ---- a hand without a glove -----------------------------------------------------------------------
// "hand:[SCRIPT][?listen=PORT]": datagrams to 127.0.0.1:PORT (20500) say where wrist and fingers shall be,
// and are answered (src/wire/hand_input.h; gloved-hand sends them from keys, tools/hand_source.py from
// Python). SCRIPT, data/scripts/hand.user where none is named: where the hand starts, and how its fingers
// close. Frames as of the simulated device, 1 kHz; what is sent reaches the simulated fingers alone: no
// force leaves. Nobody heard for 0.5 s: the dead-man switch opens. A second sender is not heard (`foreign`)
// while the first one is. Cost: a poll 3 us. On error negative with one line in err.
int gv_hand_input_open(const char *url, gv_side side, gv_driver *out, char *err, size_t err_size);

// ---- serial devices -------------------------------------------------------------------------------
// All read a serial line (8N1, raw) in poll, one system call, at most 512 bytes at a time: 0.7 us with
// nothing there, 1.8 us with a record. Frames are stamped with now_ns; their age is the time that the line
// took for their bytes and for those read behind them, and the tracker's own 4 ms (its manual). A thread of
// the driver opens, sets up and reconnects: every 0.2 s while the device is away; one that is silent for 1 s
// was reset and is set up anew. Only a line that cannot be opened at first is an error. `bad`: stretches of
// bytes that are no record (a record changed or cut on the way, garbage). `link_downs`: times that the
// device went away. send does nothing and counts nothing, but for the LucidGlove's.
//
// "serial:DEVICE?type=fastrak[&baud=115200&hand=2&head=1|none&hand2=3&hemisphere=+x|-x|+y|-y|+z|-z
//                             &format=binary|ascii]":
// Polhemus FASTRAK, POSE frames: receiver 2 from the station `hand`, receiver 1 from the station `head`, and
// receiver 2 with GV_FRAME_SECOND from the station `hand2`. A record with an error letter gives a frame with
// GV_POSE_TRACKER_ERROR and without GV_POSE_VALID.
int gv_fastrak_open(const char *url, const gv_pose *T_world_tracker, gv_driver *out, char *err,
                    size_t err_size);
// T_world_tracker of a transmitter that stands upright in the origin: its x, away from its cable,
// is the world's; its z points down.
gv_pose gv_fastrak_upright(void);
// "serial:DEVICE?type=cyberglove[&baud=115200&sensors=ask|18|22&wide=no|yes]": CyberGlove, GLOVE
// frames without dead-man switch: a bare glove lets no force out. sensors=ask (default) asks the
// glove; wide: the 16-bit stream of the CyberGlove III. The glove says which hand it is made for;
// `side` stands in for one that does not answer. `cal` is what the counts will be read with (the
// distal joints of an 18-sensor glove follow from it).
int gv_cyberglove_open(const char *url, const gv_calibration *cal, gv_side side, gv_driver *out, char *err,
                       size_t err_size);

// "serial:DEVICE?type=lucidglove[&baud=115200&max=4095|1023&dead_man=a|b|joystick&flip=no|yes]":
// LucidGloves, GLOVE frames from one bend per finger, or one per joint (see src/wire/lucidglove.h),
// FORCE_COMMAND frames to five brakes (channel.h). flip=yes: for a firmware whose FLIP_FORCE_FEEDBACK does
// not fit the glove, so that 0 are full brakes: 1000 - x is sent. The wrong choice brakes a hand that should
// be free: gloved-calibrate asks. max: the board's largest reading (1023: AVR boards). dead_man: the button
// that is the dead-man switch; a loose one lets no force out. Only the newest command counts: a line of
// brakes goes out for each line of the glove, zero brakes at once. Zero brakes follow from a command without
// ENABLE or one that does not decode, from 5 ms without a command, and from closing. The stock firmware has
// no watchdog: after SIGKILL, or with the cable out, the brakes stay where they are until the glove is
// switched off. `tx` counts commands taken, `tx_failed` lines that a newer one replaced because the line was
// full or away. Cost: a poll 2 us, with a line 8; a send 0.2 us, with a line 12.
int gv_lucidglove_open(const char *url, const gv_calibration *cal, gv_side side, gv_driver *out, char *err,
                       size_t err_size);

// "serial:DEVICE?type=doglove&servos=DEVICE[&baud=921600&dead_man=DEVICE]": a DOGlove, its main board's line
// and that of its servos (3 Mbit/s): GLOVE frames from both, no older than the older one; FORCE_COMMAND
// frames to five currents, which pull a finger to where `cal` has the open hand and no further. dead_man: an
// input device (evdev: a foot pedal, a button) any key of which is the switch while it is held; without one
// no force leaves. Zero currents follow from a command without ENABLE or one that does not decode, at once;
// from 5 ms without a command or a poll; from closing, which also switches the torque off. After SIGKILL the
// servos' Bus Watchdog stops them, 20 ms later. Cost: a poll 3 us, with a burst 10.
int gv_doglove_open(const char *url, const gv_calibration *cal, gv_side side, gv_driver *out, char *err,
                    size_t err_size);

// What a serial driver has seen. Any thread but for the counts, which belong to the thread that polls.
typedef struct gv_serial_report {
  bool connected;                // the device was set up and its records are read
  unsigned connections;          // times that this came about
  uint64_t records;              // whole ones, of every kind and station
  uint64_t bad_bytes, bad_runs;  // bytes thrown away, and unbroken stretches of them
  // CyberGlove, as told by the glove (or the URL): number of sensors, 0: not known yet; and its own
  // calibration (?C), in the order of its sensors. It is not used: the unit of its gains is not public.
  int sensors;
  bool calibrated;
  uint8_t offset[GV_SENSORS], gain[GV_SENSORS];
} gv_serial_report;
gv_serial_report gv_serial_report_of(const gv_driver *serial);

// ---- two devices as one ---------------------------------------------------------------------------
// Frames of both in the order of their stamps, POSE of the tracker alone; what is sent goes to the fcu. Ends
// with the fcu. Takes both over: closing it closes them; on error both are closed already.
int gv_pair_open(gv_driver fcu, gv_driver tracker, gv_driver *out, char *err, size_t err_size);
// The devices of two hands: frames of the second one carry GV_FRAME_SECOND, and what is sent with it goes to
// the second. one_tracker: POSE frames of both come with the first (a FASTRAK with hand2), and the second
// one's own are left out. Ends with either; the descriptor is the first one's. Takes both over likewise.
int gv_two_hands_open(gv_driver first, gv_driver second, bool one_tracker, gv_driver *out, char *err,
                      size_t err_size);

#ifdef __cplusplus
}
#endif

#endif
