// SPDX-License-Identifier: BSD-3-Clause
// The text files of gloved-trace import: a table of joint angles or counts (our own sensor names, those of
// the simulated hand in the door recordings, or as the command line names its columns) and wrist poses, and
// files of 4x4 matrices from a tracker.
#include "table.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "trace.h"

enum { LINE_MAX_BYTES = 4096, COLUMNS = 64, SPAN_MAX_S = 1000000 };
// What a row of the CSV is made into: the sensors, then these.
enum { PX = GV_SENSORS, QW = PX + 3, TIME = QW + 4, ARM_X, FIELDS = ARM_X + 3 };

// Column names besides those of the sensors. A column may feed two fields: the spread between
// two fingers is the difference of their abductions (all towards the thumb). The simulated thumb
// flexes towards negative angles.
static const struct {
  const char *column;
  int field;
  double factor;
} known[] = {{"t_s", TIME, 1},
             {"px", PX, 1},
             {"py", PX + 1, 1},
             {"pz", PX + 2, 1},
             {"qw", QW, 1},
             {"qx", QW + 1, 1},
             {"qy", QW + 2, 1},
             {"qz", QW + 3, 1},
             {"FFJ3", GV_MIDDLE_INDEX_ABDUCTION, 1},
             {"MFJ3", GV_MIDDLE_INDEX_ABDUCTION, -1},
             {"MFJ3", GV_RING_MIDDLE_ABDUCTION, 1},
             {"RFJ3", GV_RING_MIDDLE_ABDUCTION, -1},
             {"RFJ3", GV_LITTLE_RING_ABDUCTION, 1},
             {"LFJ3", GV_LITTLE_RING_ABDUCTION, -1},
             {"FFJ2", GV_INDEX_MPJ, 1},
             {"FFJ1", GV_INDEX_PIJ, 1},
             {"FFJ0", GV_INDEX_DIJ, 1},
             {"MFJ2", GV_MIDDLE_MPJ, 1},
             {"MFJ1", GV_MIDDLE_PIJ, 1},
             {"MFJ0", GV_MIDDLE_DIJ, 1},
             {"RFJ2", GV_RING_MPJ, 1},
             {"RFJ1", GV_RING_PIJ, 1},
             {"RFJ0", GV_RING_DIJ, 1},
             {"LFJ2", GV_LITTLE_MPJ, 1},
             {"LFJ1", GV_LITTLE_PIJ, 1},
             {"LFJ0", GV_LITTLE_DIJ, 1},
             {"THJ4", GV_THUMB_ROTATE, 1},
             {"THJ3", GV_THUMB_ABDUCTION, 1},
             {"THJ1", GV_THUMB_MPJ, -1},
             {"THJ0", GV_THUMB_IJ, -1},
             {"LFJ4", GV_PALM_ARCH, 1},
             {"WRJ1", GV_WRIST_YAW, 1},
             {"WRJ0", GV_WRIST_PITCH, 1},
             {"palm_x", PX, 1},
             {"palm_y", PX + 1, 1},
             {"palm_z", PX + 2, 1},
             {"ARRx", ARM_X, 1},
             {"ARRy", ARM_X + 1, 1},
             {"ARRz", ARM_X + 2, 1}};

// The hand of a recording without a wrist stands beside the table of data/scenes (1.2 m by
// 0.8 m, its top at 0), not in it.
static const double beside_table[3] = {-0.9, 0.0, 0.2};

// VirtualHand's roll of the thumb, degrees: 39 with the thumb beside the hand, 99 where it is opposed
// (least and median of public recordings of grasps; the most is 122). Ours are 0 and 0 with the flat hand,
// and rotation 25 and abduction 30 bring thumb and index finger together in precision grasps (test_hand.c):
// tips meet at 99, and at 105 to 108, with straight last bones, the pads too, within 20 degrees. The line
// through both stays within the anatomy up to 122. No recording has confirmed it; VirtualHand's own thumb
// abduction is not used.
static const double roll_flat_deg = 39.0, roll_opposed_deg = 99.0;
static const double opposed_rotation_deg = 25.0, opposed_abduction_deg = 30.0;

typedef struct table {
  const char *path;
  const table_format *format;
  char separator;
  FILE *file;
  long line;
  char text[LINE_MAX_BYTES + 2];
  int columns;
  double weight[FIELDS][COLUMNS];  // field = unit x sum of weight x column + offset
  double offset[FIELDS];
  long rows;
  bool given[FIELDS];
} table;

double *series_add(series *s) {
  if (s->count == s->capacity) {
    s->capacity = s->capacity ? 2 * s->capacity : 1024;
    s->row = realloc(s->row, s->capacity * (size_t)s->width * sizeof *s->row);
    if (!s->row)
      exit(trace_fail(EXIT_FAULT, "out of memory; import a shorter file"));
  }
  return series_row(s, s->count++);
}

void series_at(const series *s, double t, size_t *at, double *out_row) {
  while (*at + 2 < s->count && series_row(s, *at + 1)[0] <= t)
    ++*at;
  size_t i = *at;
  const double *a = series_row(s, i);
  const double *b = series_row(s, i + 1 < s->count ? i + 1 : i);
  double share = b[0] > a[0] ? gv_clamp((t - a[0]) / (b[0] - a[0]), 0, 1) : 0;
  double sign = 1;
  bool pose = s->width == POSE_WIDTH;
  if (pose && a[4] * b[4] + a[5] * b[5] + a[6] * b[6] + a[7] * b[7] < 0)
    sign = -1;
  for (int k = 1; k < s->width; k++)
    out_row[k] = (1 - share) * a[k] + share * (pose && k >= 4 ? sign : 1) * b[k];
  out_row[0] = t;
  if (!pose)
    return;
  gv_quat q = gv_quat_normalize((gv_quat){out_row[4], out_row[5], out_row[6], out_row[7]});
  out_row[4] = q.w;
  out_row[5] = q.x;
  out_row[6] = q.y;
  out_row[7] = q.z;
}

static int fail_line(const table *t, const char *what, const char *what_to_do) {
  return trace_fail(EXIT_BAD_INPUT, "%s:%ld: %s; %s", t->path, t->line, what, what_to_do);
}

static int open_table(table *t, const char *path, const table_format *format) {
  *t = (table){.path = path, .format = format, .separator = ',', .file = fopen(path, "r")};
  if (t->file)
    return EXIT_DONE;
  return trace_fail(EXIT_BAD_INPUT, "%s: cannot be opened (%s); check the path", path, strerror(errno));
}

// The end of the file, or why it cannot be read.
static int check_end(const table *t) {
  if (!ferror(t->file))
    return EXIT_DONE;
  return trace_fail(EXIT_BAD_INPUT, "%s: cannot be read (%s); give a text file", t->path, strerror(errno));
}

// The next line that is neither empty nor a comment into t->text. *out_end at the end of the file.
static int next_line(table *t, bool *out_end) {
  for (;;) {
    *out_end = !fgets(t->text, sizeof t->text, t->file);
    if (*out_end)
      return check_end(t);
    t->line++;
    if (strlen(t->text) > LINE_MAX_BYTES)
      return fail_line(t, "a line of more than 4096 characters", "give a text table");
    t->text[strcspn(t->text, "\r\n")] = 0;
    if (t->text[strspn(t->text, " \t")] && t->text[0] != '#')
      return EXIT_DONE;
  }
}

// Cut the next cell off *rest: its text without spaces around it, null after the last.
static char *next_cell(char separator, char **rest) {
  const char between[] = {separator, separator == ' ' ? '\t' : '\0', '\0'};
  char *cell = *rest;
  if (!cell)
    return NULL;
  cell += strspn(cell, " \t");
  char *end = cell + strcspn(cell, between);
  char *next = *end ? end + 1 : NULL;
  if (separator == ' ' && next && !next[strspn(next, " \t")])
    next = NULL;
  *rest = next;
  while (end > cell && (end[-1] == ' ' || end[-1] == '\t'))
    end--;
  *end = 0;
  return cell;
}

// The separator of a line: the first of these that it has.
static char separator_of(const char *line) {
  static const char known_ones[] = {';', '\t', ','};
  for (size_t i = 0; i < sizeof known_ones; i++)
    if (strchr(line, known_ones[i]))
      return known_ones[i];
  return ' ';
}

static double unit_of(const table *t, int field) {
  if (field >= GV_SENSORS)
    return 1.0;
  return t->format->unit_rad > 0 ? t->format->unit_rad : 1.0;
}

static void feed(table *t, int field, int column, double factor, double offset) {
  t->weight[field][column] = factor;
  t->offset[field] += offset * unit_of(t, field);
  t->given[field] = true;
}

// One NAME, NAME*FACTOR or NAME*FACTOR+OFFSET. False where it is not known.
static bool use_term(table *t, const char *term, int column) {
  const size_t n = strcspn(term, "*+");
  double factor = 1;
  double offset = 0;
  bool used = false;
  char *end = (char *)(term + n);
  if (*end == '*')
    factor = strtod(end + 1, &end);
  if (*end)
    offset = strtod(end, &end);
  if (*end)
    return false;
  for (int i = 0; i < GV_SENSORS; i++) {
    if (strlen(gv_sensor_name(i)) != n || strncmp(term, gv_sensor_name(i), n) != 0)
      continue;
    feed(t, i, column, factor, offset);
    used = true;
  }
  for (size_t i = 0; i < sizeof known / sizeof *known; i++) {
    if (strlen(known[i].column) != n || strncmp(term, known[i].column, n) != 0)
      continue;
    feed(t, known[i].field, column, factor * known[i].factor, offset);
    used = true;
  }
  return used;
}

// Let the column feed its fields. False where a name is not known.
static bool use_column(table *t, const char *name, int column) {
  char copy[200], *rest = copy, *term;
  bool used = true;
  snprintf(copy, sizeof copy, "%s", name);
  while ((term = next_cell('&', &rest)))
    used = use_term(t, term, column) && used;
  return used;
}

static bool all_given(const table *t, int field, int count) {
  bool all = true;
  for (int i = 0; i < count; i++)
    all = all && t->given[field + i];
  return all;
}
static bool any_given(const table *t, int field, int count) {
  bool any = false;
  for (int i = 0; i < count; i++)
    any = any || t->given[field + i];
  return any;
}

// A distal joint without a sensor follows the middle one, as tendons make it do: two thirds of its angle.
static void fill_distal_joints(table *t) {
  static const int distal[] = {GV_INDEX_DIJ, GV_MIDDLE_DIJ, GV_RING_DIJ, GV_LITTLE_DIJ};
  for (int i = 0; i < 4; i++) {
    int dij = distal[i];
    int pij = dij - 1;
    if (t->given[dij] || !t->given[pij])
      continue;
    for (int c = 0; c < t->columns; c++)
      t->weight[dij][c] = 2.0 / 3.0 * t->weight[pij][c];
    t->given[dij] = true;
    fprintf(stderr, "no column %s: two thirds of %s\n", gv_sensor_name(dij), gv_sensor_name(pij));
  }
}

// VirtualHand bends joints towards negative angles, and rolls the thumb where ours rotates and abducts.
static void apply_virtualhand(table *t) {
  const double deg = GV_PI / 180;
  const double range = roll_opposed_deg - roll_flat_deg;
  const double rotation = opposed_rotation_deg / range;
  const double abduction = opposed_abduction_deg / range;
  for (int c = 0; c < t->columns; c++) {
    const double roll = t->weight[GV_THUMB_ROTATE][c];
    for (int f = 0; f < GV_FINGERS; f++)
      for (int j = 0; j < 3; j++)
        if (gv_flexion[f][j] != GV_THUMB_ROTATE)
          t->weight[gv_flexion[f][j]][c] *= -1;
    t->weight[GV_THUMB_ROTATE][c] = rotation * roll;
    t->weight[GV_THUMB_ABDUCTION][c] = abduction * roll;
  }
  t->offset[GV_THUMB_ROTATE] = -rotation * roll_flat_deg * deg;
  t->offset[GV_THUMB_ABDUCTION] = -abduction * roll_flat_deg * deg;
  t->given[GV_THUMB_ABDUCTION] = t->given[GV_THUMB_ROTATE];
}

static int check_header(table *t) {
  if (!t->given[TIME] && t->format->rows_hz <= 0)
    return fail_line(t, "no column t_s",
                     "the first line names the columns: t_s in seconds, sensors in radians; or give --rows "
                     "HZ and --columns");
  if (!any_given(t, 0, GV_SENSORS))
    return fail_line(t, "no column of a sensor",
                     "name them thumb_rotate, thumb_mpj, ... (gloved-trace --help)");
  if (any_given(t, PX, 3) && !all_given(t, PX, 3))
    return fail_line(t, "a position without all of px py pz", "give the three or none");
  if (any_given(t, QW, 4) && !all_given(t, QW, 4))
    return fail_line(t, "an orientation without all of qw qx qy qz", "give the four or none");
  if (t->format->virtualhand)
    apply_virtualhand(t);
  fill_distal_joints(t);
  for (int i = 0; i < GV_SENSORS; i++)
    if (!t->given[i])
      fprintf(stderr, "no column %s: 0\n", gv_sensor_name(i));
  return EXIT_DONE;
}

static int add_column(table *t, const char *name) {
  if (t->columns == COLUMNS)
    return fail_line(t, "more than 64 columns", "leave out what is not needed");
  if (strcmp(name, "-") != 0 && !use_column(t, name, t->columns)) {
    if (t->format->columns)
      return trace_fail(EXIT_BAD_INPUT, "import: --columns: %s is no column; see gloved-trace --help", name);
    fprintf(stderr, "column %s: not used\n", name);
  }
  t->columns++;
  return EXIT_DONE;
}

// The sensors of a CyberGlove in its order; the one of 18 lacks the distal joints of the fingers.
static int add_glove(table *t, bool all) {
  int code = EXIT_DONE;
  for (int i = 0; i < GV_SENSORS && !code; i++) {
    const bool distal = i == GV_INDEX_DIJ || i == GV_MIDDLE_DIJ || i == GV_RING_DIJ || i == GV_LITTLE_DIJ;
    if (all || !distal)
      code = add_column(t, gv_sensor_name(i));
  }
  return code;
}

// Columns as the tools of public recordings write them. Order: GraspDB14's parser (namemapCyberglove.m,
// readDBKSmotion.m: date and time, a switch, 23 angles of which the index finger's own abduction is not
// measured, radians or counts); VMG 30 (LucaPalumbo/dataglove, vmg30.py: a tick, seconds, 23 readings of 0 to
// 1000, two quaternions of unknown frames). A reading of the VMG 30 is taken as a share of its joint's range,
// in degrees; what its abduction sensors turn is not published.
static const struct {
  const char *name, *columns;
} maps[] = {
  {"graspdb14",
   "-,-,-,-,-,-,-,thumb_rotate,thumb_mpj,thumb_ij,thumb_abduction,index_mpj,index_pij,index_dij,-,middle_mpj,"
   "middle_pij,middle_dij,middle_index_abduction,ring_mpj,ring_pij,ring_dij,ring_middle_abduction,little_mpj,"
   "little_pij,little_dij,little_ring_abduction,palm_arch,wrist_pitch,wrist_yaw"},
  {"vmg30", "-,t_s,thumb_ij*0.08,thumb_mpj*0.06,index_pij*0.1,index_mpj*0.09,middle_pij*0.1,middle_mpj*0.09,"
            "ring_pij*0.1,"
            "ring_mpj*0.09,little_pij*0.1,little_mpj*0.09,palm_arch*0.04,-,thumb_abduction*0.06,-,-,-,-,-,-,-"
            ",-,-,-,-,-,"
            "-,-,-,-,-,-"},
};

static int add_map(table *t, const char *columns) {
  char copy[LINE_MAX_BYTES], *rest = copy, *name;
  int code = EXIT_DONE;
  snprintf(copy, sizeof copy, "%s", columns);
  while (!code && (name = next_cell(',', &rest)))
    code = add_column(t, name);
  return code;
}

static const char *map_of(const char *name) {
  for (size_t i = 0; i < sizeof maps / sizeof *maps; i++)
    if (strcmp(maps[i].name, name) == 0)
      return maps[i].columns;
  return NULL;
}

static int name_columns(table *t) {
  char copy[LINE_MAX_BYTES], *rest = copy, *name;
  int code = EXIT_DONE;
  snprintf(copy, sizeof copy, "%s", t->format->columns);
  while (!code && (name = next_cell(',', &rest))) {
    const bool all = strcmp(name, "cyberglove22") == 0;
    const char *map = map_of(name);
    if (all || strcmp(name, "cyberglove18") == 0)
      code = add_glove(t, all);
    else
      code = map ? add_map(t, map) : add_column(t, name);
  }
  return code;
}

static bool read_number(const char *text, double *out);

// Whether the line's first cell is a number: then the table has no header.
static bool begins_with_number(const table *t) {
  char copy[LINE_MAX_BYTES + 2], *rest = copy;
  double ignored;
  snprintf(copy, sizeof copy, "%s", t->text);
  return read_number(next_cell(t->separator, &rest), &ignored);
}

// Leaves the first row of numbers in t->text where *out_row.
static int read_header(table *t, bool *out_row) {
  bool end;
  char *rest = t->text, *name, names[COLUMNS][32];
  if (next_line(t, &end))
    return EXIT_BAD_INPUT;
  if (end)
    return trace_fail(EXIT_BAD_INPUT, "%s: empty; the first line names the columns", t->path);
  t->separator = separator_of(t->text);
  *out_row = false;
  if (t->format->columns) {
    *out_row = begins_with_number(t);
    const int code = name_columns(t);
    return code ? code : check_header(t);
  }
  while ((name = next_cell(t->separator, &rest))) {
    if (t->columns == COLUMNS)
      return fail_line(t, "more than 64 columns", "leave out what is not needed");
    snprintf(names[t->columns], sizeof names[0], "%.31s", name);
    for (int i = 0; i < t->columns; i++)
      if (strcmp(names[i], names[t->columns]) == 0)
        return fail_line(t, "two columns of one name", "keep one of them");
    if (add_column(t, name))
      return EXIT_BAD_INPUT;
  }
  return check_header(t);
}

// A finite number that fills the whole text.
static bool read_number(const char *text, double *out) {
  char *end;
  *out = strtod(text, &end);
  return end != text && *end == 0 && isfinite(*out);
}

// Counts become the angles that the default calibration has for them; sensors that
// are not there stay straight.
static void counts_to_angles(const table *t, double field[FIELDS]) {
  const gv_calibration cal = gv_calibration_default();
  for (int i = 0; i < GV_SENSORS; i++)
    field[i] = t->given[i] ? gv_calibration_angle(&cal, i, field[i] * 4095 / t->format->counts) : 0.0;
}

// The cells of the row into the fields.
static int read_fields(table *t, double out[FIELDS]) {
  char *rest = t->text, *cell;
  double value[COLUMNS];
  for (int c = 0; c < t->columns; c++) {
    if (!(cell = next_cell(t->separator, &rest)))
      return fail_line(t, "fewer cells than the header has columns", "complete the row");
    if (!read_number(cell, &value[c]))
      return fail_line(t, "a cell that is no finite number", "correct or remove the row");
  }
  if (rest)
    return fail_line(t, "more cells than the header has columns", "correct the row");
  for (int f = 0; f < FIELDS; f++) {
    double sum = 0;
    for (int c = 0; c < t->columns; c++)
      sum += t->weight[f][c] * value[c];
    out[f] = sum * unit_of(t, f) + t->offset[f];
  }
  if (!t->given[TIME])
    out[TIME] = (double)t->rows / t->format->rows_hz;
  if (!t->given[PX])
    memcpy(out + PX, beside_table, sizeof beside_table);
  if (t->format->unit_rad <= 0)
    counts_to_angles(t, out);
  t->rows++;
  return EXIT_DONE;
}

static gv_quat field_rotation(const table *t, const double field[FIELDS]) {
  if (t->given[QW])
    return (gv_quat){field[QW], field[QW + 1], field[QW + 2], field[QW + 3]};
  gv_quat x = gv_quat_axis_angle(gv_v3(1, 0, 0), field[ARM_X]);
  gv_quat y = gv_quat_axis_angle(gv_v3(0, 1, 0), field[ARM_X + 1]);
  return gv_quat_mul(gv_quat_mul(x, y), gv_quat_axis_angle(gv_v3(0, 0, 1), field[ARM_X + 2]));
}

// The wire carries positions up to 214 m: more than 200 is another unit or a slip.
static bool position_far(const double p[3]) {
  return fabs(p[0]) > 200 || fabs(p[1]) > 200 || fabs(p[2]) > 200;
}

static int add_row(const table *t, const double field[FIELDS], double start_s, series *hand, series *pose) {
  double time_s = field[TIME] - start_s;
  if (hand->count > 0 && time_s <= series_row(hand, hand->count - 1)[0])
    return fail_line(t, "t_s does not rise", "put the rows in order of time, one per time");
  if (time_s > SPAN_MAX_S)
    return fail_line(t, "t_s is more than 1e6 s after the first row", "give seconds");
  if (position_far(field + PX))
    return fail_line(t, "a position beyond 200 m", "give metres");
  gv_quat q = field_rotation(t, field);
  if (fabs(sqrt(q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z) - 1) > 0.01)
    return fail_line(t, "qw qx qy qz is no unit quaternion", "give one of length 1");
  q = gv_quat_normalize(q);
  double *h = series_add(hand);
  double *p = series_add(pose);
  h[0] = time_s;
  memcpy(h + 1, field, GV_SENSORS * sizeof *field);
  const double values[POSE_WIDTH] = {time_s, field[PX], field[PX + 1], field[PX + 2], q.w, q.x, q.y, q.z};
  memcpy(p, values, sizeof values);
  return EXIT_DONE;
}

// row: the first one is in t->text already.
static int read_rows(table *t, bool row, series *hand, series *pose) {
  double field[FIELDS], start_s = 0;
  bool end = false;
  for (;; row = false) {
    if (!row && next_line(t, &end))
      return EXIT_BAD_INPUT;
    if (end && hand->count > 0)
      return EXIT_DONE;
    if (end)
      return fail_line(t, "no row below the header", "add rows of numbers");
    if (read_fields(t, field))
      return EXIT_BAD_INPUT;
    if (hand->count == 0)
      start_s = field[TIME];
    if (add_row(t, field, start_s, hand, pose))
      return EXIT_BAD_INPUT;
  }
}

int table_read_csv(const char *path, const table_format *format, series *out_hand, series *out_pose) {
  table t;
  bool row = false;
  *out_hand = (series){.width = HAND_WIDTH};
  *out_pose = (series){.width = POSE_WIDTH};
  if (open_table(&t, path, format))
    return EXIT_BAD_INPUT;
  int code = read_header(&t, &row);
  if (!code)
    code = read_rows(&t, row, out_hand, out_pose);
  fclose(t.file);
  return code;
}

// Unit quaternion of a rotation matrix, from the largest of its four components (Shepperd's method).
static gv_quat quat_from_matrix(const double m[16]) {
  double xx = m[0];
  double yy = m[5];
  double zz = m[10];
  double trace = xx + yy + zz;
  gv_quat q;
  if (trace >= xx && trace >= yy && trace >= zz)
    q = (gv_quat){1 + trace, m[9] - m[6], m[2] - m[8], m[4] - m[1]};
  else if (xx >= yy && xx >= zz)
    q = (gv_quat){m[9] - m[6], 1 + xx - yy - zz, m[1] + m[4], m[2] + m[8]};
  else if (yy >= zz)
    q = (gv_quat){m[2] - m[8], m[1] + m[4], 1 - xx + yy - zz, m[6] + m[9]};
  else
    q = (gv_quat){m[4] - m[1], m[2] + m[8], m[6] + m[9], 1 - xx - yy + zz};
  return gv_quat_normalize(q);
}

// A rigid motion up to what six printed digits lose: the quaternion gives the matrix back.
static bool matrix_rigid(const double m[16], gv_quat q) {
  gv_mat3 R = gv_mat3_from_quat(q);
  bool rigid = m[12] == 0 && m[13] == 0 && m[14] == 0 && m[15] == 1;
  for (int i = 0; i < 9; i++)
    rigid = rigid && fabs(R.m[i / 3][i % 3] - m[4 * (i / 3) + i % 3]) < 0.01;
  return rigid;
}

// Four numbers of the line into out.
static bool read_four(const char *text, double out[4]) {
  char *end;
  for (int i = 0; i < 4; i++, text = end) {
    out[i] = strtod(text, &end);
    if (end == text || !isfinite(out[i]))
      return false;
  }
  return text[strspn(text, " \t")] == 0;
}

static int read_matrices(table *t, double rate_hz, series *pose) {
  double m[16];
  bool end;
  for (int row = 0;; row = (row + 1) % 4) {
    if (next_line(t, &end))
      return EXIT_BAD_INPUT;
    if (end && (row > 0 || pose->count == 0))
      return fail_line(t, "the last matrix is not complete", "give four lines of four numbers for each");
    if (end)
      return EXIT_DONE;
    if (!read_four(t->text, m + 4 * row))
      return fail_line(t, "not four numbers", "give four lines of four numbers for each matrix");
    if (row < 3)
      continue;
    gv_quat q = quat_from_matrix(m);
    if (!matrix_rigid(m, q))
      return fail_line(t, "the matrix that ends here is no rotation and position",
                       "give rows R p and a last row 0 0 0 1");
    const double values[POSE_WIDTH] = {(double)pose->count / rate_hz, m[3], m[7], m[11], q.w, q.x, q.y, q.z};
    if (position_far(values + 1))
      return fail_line(t, "a position beyond 200 m in the matrix that ends here", "give metres");
    memcpy(series_add(pose), values, sizeof values);
  }
}

int table_read_matrices(const char *path, double rate_hz, series *out_pose) {
  table t;
  *out_pose = (series){.width = POSE_WIDTH};
  if (open_table(&t, path, NULL))
    return EXIT_BAD_INPUT;
  int code = read_matrices(&t, rate_hz, out_pose);
  fclose(t.file);
  return code;
}
