#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# The walls of the design, checked on the source text: the core is pure, a driver knows no engine, one file
# knows each library, data flows one way.
set -u
fails=0
# wall NAME PATTERN FILE...: no line of the files matches the pattern (comments apart).
wall() {
  name=$1 pattern=$2; shift 2
  hits=$(for f; do sed 's,//.*,,' "$f" | grep -nE "$pattern" | sed "s,^,$f:,"; done)
  if [ -n "$hits" ]; then echo "$hits"; echo "FAIL $name"; fails=1; else echo "ok $name"; fi
}
# only NAME PATTERN ALLOWED: nobody but the allowed file matches.
only() {
  others=$(grep -lE "$2" src/*/*.[ch] src/*/*/*.[ch] drivers/*.[ch] tools/*.[ch] include/gloved/*.h 2>/dev/null | grep -vxE "$3")
  if [ -n "$others" ]; then echo "$others"; echo "FAIL $1"; fails=1; else echo "ok $1"; fi
}
# room NAME [OTHERS]: the room includes from itself, from the public headers and from these others alone.
room() {
  hits=$(grep -nE '#include "(base|hand|collision|dynamics|safety|wire|engine|drivers|daemon/[a-z]+)/' src/"$1"/*.[ch] |
    grep -vE "#include \"($1${2:+|$2})/")
  if [ -n "$hits" ]; then echo "$hits"; echo "FAIL room_$1"; fails=1; else echo "ok room_$1"; fi
}
core="$(ls src/base/*.[ch] src/hand/*.[ch] src/collision/*.[ch] src/dynamics/*.[ch] src/safety/*.[ch] src/engine/*.[ch])"; drivers="$(ls drivers/*.[ch])"
wall core_has_no_heap '\b(malloc|calloc|realloc|free|strdup|alloca)[[:space:]]*\(' $core
wall core_has_no_input_output '\b(printf|fprintf|snprintf|puts|fopen|open|read|write|socket|ioctl)[[:space:]]*\(|<(stdio|fcntl|unistd|sys/[a-z]+)\.h>' $core
wall core_has_no_clock_or_thread '<(time|pthread|threads|signal|sched)\.h>|\b(clock_gettime|nanosleep|pthread_[a-z_]+|time)[[:space:]]*\(' $core
wall core_has_no_library_trigonometry '\b(sin|cos|tan|asin|acos|atan|atan2|exp|log|pow|cbrt|hypot|fmod|sincos)[[:space:]]*\(' $core
wall core_knows_no_process_or_driver '#include "(daemon|drivers|wire)/|#include "gloved/(drivers|frame|fcu)\.h"' $core
wall drivers_know_no_engine '#include "gloved/(engine|narrow|scene|shape|safety)\.h"|"(hand|collision|dynamics|safety|engine|daemon)/' $drivers
only one_file_knows_ode '#include <ode/' 'src/dynamics/ode(_joint\.[ch]|\.c)'
only one_file_knows_ccd '#include <ccd/' 'src/collision/libccd\.c'
only the_telemetry_alone_knows_lcm '#include <lcm/|#include "gloved_.*_t\.h"' 'src/daemon/tell/telemetry(_[a-z]+)?\.[ch]|tools/gloved-(top|command)\.c'
only one_file_knows_libconfig '#include <libconfig' 'src/daemon/load/conf\.c'
only one_file_knows_zlib '#include <zlib' 'drivers/log_file\.c'
wall the_parts_know_no_engine '#include "gloved/engine\.h"' src/base/*.[ch] src/hand/*.[ch] src/collision/*.[ch] src/dynamics/*.[ch] src/safety/*.[ch] src/wire/*.[ch]
room base
room hand base
room collision base
room dynamics 'base|hand'
room safety base
room wire base
room engine 'base|hand|collision|dynamics'
room daemon/load
room daemon/loop 'daemon/load|safety|wire'
room daemon/tell 'daemon/load|daemon/loop'
room daemon/doctor 'daemon/load|daemon/tell'
exit $fails
