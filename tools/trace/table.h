// SPDX-License-Identifier: BSD-3-Clause
// Rows of numbers over time, read from the text files that gloved-trace import takes.
#ifndef TABLE_H
#define TABLE_H

#include <stdbool.h>
#include <stddef.h>

#include "gloved/hand.h"

// Columns of a hand row: time, 22 joint angles; of a pose row: time, position, quaternion w x y z.
enum { HAND_WIDTH = 1 + GV_SENSORS, POSE_WIDTH = 8 };

typedef struct series {
  int width;  // numbers in a row; the first is the time in seconds, from 0 and rising
  size_t count, capacity;
  double *row;  // count x width
} series;

// Row i of s.
static inline double *series_row(const series *s, size_t i) { return s->row + i * (size_t)s->width; }
// A row for the caller to fill; ends the program where memory is out.
double *series_add(series *s);
// Values at time t: linear between rows, held beyond the ends; a pose's quaternion the short way, made unit.
// *at: 0 at first; the times of one pass must rise.
void series_at(const series *s, double t, size_t *at, double *out_row);

// How a table is to be read.
typedef struct table_format {
  // What its columns are, in order, joined by commas; null: its first line says so. A column is a name, "-"
  // for one that is not used, cyberglove22 or cyberglove18 for those sensors in the glove's order, or
  // NAME*FACTOR+OFFSET, several of them joined by & where one column feeds several sensors.
  const char *columns;
  double unit_rad;   // of the sensors' columns: 1, or pi / 180 for degrees; 0: they are counts
  double counts;     // largest count
  double rows_hz;    // rows without a time are so far apart; 0: there must be a column t_s
  bool virtualhand;  // angles as VirtualHand has them: flexion negative, the thumb's roll in place
                     // of its rotation
} table_format;

// A table (comma, semicolon, tab or blanks between its cells) into hand rows and pose rows. Says in
// words, on standard error, what it filled in or left out. Both return an exit code, with one line on
// standard error where it is not 0.
int table_read_csv(const char *path, const table_format *format, series *out_hand, series *out_pose);
// 4x4 matrices row by row, rate_hz of them a second, into pose rows.
int table_read_matrices(const char *path, double rate_hz, series *out_pose);

#endif
