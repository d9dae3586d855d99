// SPDX-License-Identifier: BSD-3-Clause
// The scripted user: a text of postures and keyframes (format: sim.h), read in set-up, and what the user
// means to do at a time: minimum-jerk curves 10 s^3 - 15 s^4 + 6 s^5 from keyframe to keyframe, the way
// people reach (Flash and Hogan 1985), the orientation along the shortest arc.
#include "gloved/drivers.h"
#include "gloved/sim.h"

#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { LINE_MAX_BYTES = 1024, WORDS_MAX = 96, FILE_MAX_BYTES = 1 << 20 };

typedef struct posture {
  char name[GV_MAX_NAME];
  uint32_t set;  // bit per sensor that it names
  double angle_rad[GV_SENSORS];
} posture;

typedef struct parser {
  gv_sim_script *script;
  const char *name;
  int line;
  char *err;
  size_t err_size;
  posture postures[GV_SIM_POSTURES];
  int posture_count;
  bool end_given;
  char *word[WORDS_MAX];  // of the present line
  int words, at;          // how many; the next one to read
} parser;

__attribute__((format(printf, 2, 3))) static int fail(parser *p, const char *format, ...) {
  int n = snprintf(p->err, p->err_size, "%s:%d: ", p->name, p->line);
  if (n >= 0 && (size_t)n < p->err_size) {
    va_list args;
    va_start(args, format);
    vsnprintf(p->err + n, p->err_size - (size_t)n, format, args);
    va_end(args);
  }
  return -1;
}

static const char *next_word(parser *p) { return p->at < p->words ? p->word[p->at++] : NULL; }

static bool take(parser *p, const char *word) {
  if (p->at >= p->words || strcmp(p->word[p->at], word) != 0)
    return false;
  p->at++;
  return true;
}

static int read_number(parser *p, const char *what, double min, double max, double *out) {
  const char *word = next_word(p);
  if (!word)
    return fail(p, "%s is missing; give a number from %g to %g", what, min, max);
  char *end;
  *out = strtod(word, &end);
  if (end == word || *end || !(*out >= min && *out <= max))
    return fail(p, "%s is \"%.40s\"; give a number from %g to %g", what, word, min, max);
  return 0;
}

static int read_pose(parser *p, gv_pose *out) {
  double v[6];
  for (int i = 0; i < 6; i++) {
    static const char *const part[6] = {"x (m)",          "y (m)",           "z (m)",
                                        "roll (degrees)", "pitch (degrees)", "yaw (degrees)"};
    double limit = i < 3 ? 10.0 : 360.0;
    if (read_number(p, part[i], -limit, limit, &v[i]))
      return -1;
  }
  double deg = GV_PI / 180.0;
  gv_quat roll = gv_quat_axis_angle(gv_v3(1, 0, 0), v[3] * deg);
  gv_quat pitch = gv_quat_axis_angle(gv_v3(0, 1, 0), v[4] * deg);
  gv_quat yaw = gv_quat_axis_angle(gv_v3(0, 0, 1), v[5] * deg);
  *out = (gv_pose){gv_quat_normalize(gv_quat_mul(yaw, gv_quat_mul(pitch, roll))), {v[0], v[1], v[2]}};
  return 0;
}

static int find_sensor(const char *name) {
  for (int i = 0; i < GV_SENSORS; i++)
    if (strcmp(name, gv_sensor_name(i)) == 0)
      return i;
  return -1;
}

// "SENSOR ANGLE", the name not yet read.
static int read_angle(parser *p, uint32_t *set, double angle_rad[GV_SENSORS]) {
  const char *word = next_word(p);
  int sensor = find_sensor(word);
  if (sensor < 0)
    return fail(p,
                "\"%.40s\" is neither a sensor nor a keyword here; sensors are named like index_mpj (hand.h)",
                word);
  double degrees;
  if (read_number(p, word, -180, 180, &degrees))
    return -1;
  angle_rad[sensor] = degrees * (GV_PI / 180.0);
  *set |= 1u << sensor;
  return 0;
}

static posture *find_posture(parser *p, const char *name) {
  for (int i = 0; i < p->posture_count; i++)
    if (strcmp(name, p->postures[i].name) == 0)
      return &p->postures[i];
  return NULL;
}

static int read_posture_name(parser *p, posture **out) {
  const char *name = next_word(p);
  if (!name)
    return fail(p, "the posture's name is missing");
  *out = find_posture(p, name);
  return *out ? 0
              : fail(p, "no posture \"%.40s\" above; define it with: posture %.31s SENSOR ANGLE ...", name,
                     name);
}

static int parse_posture(parser *p) {
  const char *name = next_word(p);
  if (!name || strlen(name) >= GV_MAX_NAME)
    return fail(p, "give the posture a name of at most %d letters", GV_MAX_NAME - 1);
  posture *mine = find_posture(p, name);
  if (!mine) {
    if (p->posture_count == GV_SIM_POSTURES)
      return fail(p, "more than GV_SIM_POSTURES (%d) postures; use fewer", GV_SIM_POSTURES);
    mine = &p->postures[p->posture_count];
    *mine = (posture){.set = 0};
    snprintf(mine->name, sizeof mine->name, "%s", name);
  }
  if (take(p, "like")) {
    posture *other;
    if (read_posture_name(p, &other))
      return -1;
    mine->set = other->set;
    memcpy(mine->angle_rad, other->angle_rad, sizeof mine->angle_rad);
  }
  while (p->at < p->words)
    if (read_angle(p, &mine->set, mine->angle_rad))
      return -1;
  if (mine == &p->postures[p->posture_count])
    p->posture_count++;
  return 0;
}

static int apply_posture(parser *p, gv_sim_keyframe *key) {
  posture *named;
  if (read_posture_name(p, &named))
    return -1;
  for (int i = 0; i < GV_SENSORS; i++)
    if (named->set >> i & 1)
      key->angle_rad[i] = named->angle_rad[i];
  return 0;
}

static int parse_switch(parser *p, bool *out) {
  *out = take(p, "on");
  return *out || take(p, "off") ? 0 : fail(p, "dead_man wants on or off");
}

static int parse_keyframe(parser *p) {
  gv_sim_script *s = p->script;
  int n = s->keyframe_count;
  if (n == GV_SIM_KEYFRAMES)
    return fail(p, "more than GV_SIM_KEYFRAMES (%d) keyframes; use fewer", GV_SIM_KEYFRAMES);
  gv_sim_keyframe *key = &s->keyframe[n];
  *key = n ? s->keyframe[n - 1] : (gv_sim_keyframe){.T_world_wrist = {{1, 0, 0, 0}, {0, 0, 0}}};
  if (read_number(p, "the time (s)", 0, 3600, &key->time_s))
    return -1;
  if (n && key->time_s <= s->keyframe[n - 1].time_s)
    return fail(p, "time %g is not after the keyframe before it (%g); put keyframes in order", key->time_s,
                s->keyframe[n - 1].time_s);
  bool posed = n > 0;
  bool placed = n > 0;
  while (p->at < p->words) {
    uint32_t set = 0;
    int error;
    if (take(p, "posture")) {
      posed = true;
      error = apply_posture(p, key);
    } else if (take(p, "wrist")) {
      placed = true;
      error = read_pose(p, &key->T_world_wrist);
    } else if (take(p, "dead_man"))
      error = parse_switch(p, &key->dead_man);
    else
      error = read_angle(p, &set, key->angle_rad);
    if (error)
      return -1;
  }
  if (!posed || !placed)
    return fail(p, "the first keyframe must name a posture and a wrist pose");
  s->keyframe_count++;
  return 0;
}

static int parse_device(parser *p) {
  if (take(p, "best"))
    p->script->device = gv_sim_device_best();
  else if (take(p, "real"))
    p->script->device = gv_sim_device_real();
  while (p->at < p->words) {
    const char *name = next_word(p);
    const char *value = next_word(p);
    char why[256];
    if (!value)
      return fail(p, "device wants best, real, or NAME VALUE; \"%.40s\" has no value", name);
    if (gv_sim_device_set(&p->script->device, name, value, why, sizeof why))
      return fail(p, "%s", why);
  }
  return 0;
}

static int parse_hand(parser *p) {
  bool left = take(p, "left");
  p->script->side = left ? GV_LEFT : GV_RIGHT;
  return left || take(p, "right") ? 0 : fail(p, "hand wants right or left");
}

static int parse_seed(parser *p) {
  double seed;
  if (read_number(p, "the seed", 1, 4294967295.0, &seed))
    return -1;
  p->script->seed = (uint64_t)seed;
  return 0;
}

static int parse_words(parser *p) {
  if (take(p, "at"))
    return parse_keyframe(p);
  if (take(p, "posture"))
    return parse_posture(p);
  if (take(p, "device"))
    return parse_device(p);
  if (take(p, "seed"))
    return parse_seed(p);
  if (take(p, "hand"))
    return parse_hand(p);
  if (take(p, "head"))
    return read_pose(p, &p->script->T_world_head);
  if (take(p, "end")) {
    p->end_given = true;
    return read_number(p, "the end (s)", 0, 3600, &p->script->end_s);
  }
  return fail(p, "unknown word \"%.40s\"; a line starts with at, posture, device, seed, hand, head or end",
              p->word[0]);
}

// Split a line in place; a comment ends it.
static int split_words(parser *p, char *line) {
  p->words = p->at = 0;
  char *comment = strchr(line, '#');
  char *save = NULL;
  if (comment)
    *comment = '\0';
  for (char *word = strtok_r(line, " \t\r", &save); word; word = strtok_r(NULL, " \t\r", &save)) {
    if (p->words == WORDS_MAX)
      return fail(p, "more than %d words in one line; split it", WORDS_MAX);
    p->word[p->words++] = word;
  }
  return 0;
}

static int parse_line(parser *p, const char *text, size_t length) {
  char line[LINE_MAX_BYTES];
  if (length >= sizeof line)
    return fail(p, "a line of more than %d bytes; split it", LINE_MAX_BYTES - 1);
  memcpy(line, text, length);
  line[length] = '\0';
  if (split_words(p, line))
    return -1;
  if (p->words == 0)
    return 0;
  if (parse_words(p))
    return -1;
  return p->at == p->words ? 0 : fail(p, "\"%.40s\" is left over; remove it", p->word[p->at]);
}

static int check_script(parser *p) {
  gv_sim_script *s = p->script;
  if (s->keyframe_count == 0)
    return fail(p, "no keyframe; add a line: at 0 posture NAME wrist X Y Z ROLL PITCH YAW");
  double last_s = s->keyframe[s->keyframe_count - 1].time_s;
  if (!p->end_given)
    s->end_s = last_s;
  if (s->end_s < last_s)
    return fail(p, "end %g is before the last keyframe (%g)", s->end_s, last_s);
  char why[128];
  if (gv_sim_device_check(&s->device, why, sizeof why))
    return fail(p, "%s", why);
  return 0;
}

int gv_sim_script_parse(const char *text, const char *name, gv_sim_script *out, char *err, size_t err_size) {
  parser p = {.script = out, .name = name, .err = err, .err_size = err_size};
  // The head looks down on the origin from half a metre behind and above the hand.
  *out = (gv_sim_script){.device = gv_sim_device_best(),
                         .seed = 1,
                         .side = GV_RIGHT,
                         .T_world_head = {gv_quat_axis_angle(gv_v3(0, 1, 0), 0.25 * GV_PI), {-0.5, 0, 0.5}}};
  for (const char *line = text; *line;) {
    size_t length = strcspn(line, "\n");
    p.line++;
    if (parse_line(&p, line, length))
      return -1;
    line += length + (line[length] == '\n');
  }
  return check_script(&p);
}

int gv_sim_script_load(const char *path, gv_sim_script *out, char *err, size_t err_size) {
  char found[4096];
  gv_data_path(path, "scripts", ".user", found, sizeof found);
  FILE *file = fopen(found, "rb");
  if (!file) {
    snprintf(err, err_size, "%s: %s; give a script such as data/scripts/power_box.user", path,
             strerror(errno));
    return -1;
  }
  char *text = malloc(FILE_MAX_BYTES + 1);
  size_t length = text ? fread(text, 1, FILE_MAX_BYTES + 1, file) : 0;
  int result = -1;
  if (!text || ferror(file))
    snprintf(err, err_size, "%s: cannot be read: %s; give a script file", path, strerror(errno));
  else if (length > FILE_MAX_BYTES)
    snprintf(err, err_size, "%s: more than %d bytes; this is no script", path, FILE_MAX_BYTES);
  else if (memchr(text, '\0', length))
    snprintf(err, err_size, "%s: holds a zero byte; this is no script", path);
  else {
    text[length] = '\0';
    result = gv_sim_script_parse(text, path, out, err, err_size);
  }
  free(text);
  fclose(file);
  return result;
}

static double minimum_jerk(double s) { return s * s * s * (10.0 + s * (6.0 * s - 15.0)); }

static gv_pose blend_pose(gv_pose a, gv_pose b, double s) {
  gv_quat arc = gv_quat_mul(gv_quat_conj(a.q), b.q);
  gv_quat part = gv_quat_exp(gv_scale(gv_quat_log(arc), s));
  return (gv_pose){gv_quat_normalize(gv_quat_mul(a.q, part)), gv_mad(a.p, s, gv_sub(b.p, a.p))};
}

gv_sim_keyframe gv_sim_script_at(const gv_sim_script *script, double time_s) {
  const gv_sim_keyframe *key = script->keyframe;
  int n = 1;
  while (n < script->keyframe_count && key[n].time_s <= time_s)
    n++;
  gv_sim_keyframe out = key[n - 1];  // dead_man holds from its keyframe on
  out.time_s = time_s;
  if (n == script->keyframe_count || time_s <= key[0].time_s)
    return out;
  const gv_sim_keyframe *a = &key[n - 1];
  const gv_sim_keyframe *b = &key[n];
  double s = minimum_jerk((time_s - a->time_s) / (b->time_s - a->time_s));
  for (int i = 0; i < GV_SENSORS; i++)
    out.angle_rad[i] = a->angle_rad[i] + s * (b->angle_rad[i] - a->angle_rad[i]);
  out.T_world_wrist = blend_pose(a->T_world_wrist, b->T_world_wrist, s);
  return out;
}
