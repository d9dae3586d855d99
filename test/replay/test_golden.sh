#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# The same trace gives the same bits everywhere: other compilers and optimization levels (each builds without
# a warning), and the daemon itself with and without real-time scheduling, twice.
set -u
: "${B:?the build directory}"
fails=0
unset MAKEFLAGS MAKELEVEL
say() { if [ "$1" = 0 ]; then echo "ok $2"; else echo "FAIL $2"; fails=1; fi; }

for build in gcc-O0 clang-O2 clang-O0; do
  # Without optimization a trace takes 3 s: two of them, a box and a compound.
  case $build in *-O0) names="power_box bar_frame" ;; *) names= ;; esac
  log=$B/test/log/build-$build
  make -j"$(nproc)" CI=1 CC="${build%-*}" OPT="-${build#*-}" B="build/$build" "build/$build/gloved" "build/$build/test/test_replay" >"$log" 2>&1
  code=$?; [ $code = 0 ] || tail -n 5 "$log"
  say $code "builds_without_warnings_$build"
  [ $code = 0 ] || continue
  "build/$build/test/test_replay" --hashes $names >"$log.run" 2>&1
  code=$?; [ $code = 0 ] || cat "$log.run"
  say $code "same_bits_$build"
done

trace=$(ls data/traces | head -n 1)
want=$(sed -n 's/^hash_default //p' "data/traces/$trace/expected")
scene=$(sed -n 's/^scene //p' "data/traces/$trace/expected")
for option in "" "" --no-rt; do
  "$B/gloved" --fcu "trace:data/traces/$trace/input.log.gz?speed=0" --scene "$scene" --lcm none $option --summary "$B/test/golden.json" >"$B/test/log/golden" 2>&1
  code=$?
  got=$(sed -n 's/.*"state_hash": "\([0-9a-f]*\)".*/\1/p' "$B/test/golden.json")
  [ $code = 0 ] && [ -n "$want" ] && [ "$got" = "$want" ]
  code=$?; [ $code = 0 ] || { cat "$B/test/log/golden"; echo "  $trace: $got, expected $want"; }
  say $code "daemon_replays_to_the_golden_hash${option:+_$option}"
  grep -q '"rt_heap_calls": 0,' "$B/test/golden.json" && grep -q '"rt_page_faults": {"major": 0, "minor": 0}' "$B/test/golden.json"
  code=$?; [ $code = 0 ] || grep -E 'heap|faults' "$B/test/golden.json"
  say $code "no_heap_call_and_no_page_fault${option:+_$option}"
done
exit $fails
