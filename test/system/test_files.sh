#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# The files that gloved writes and the signals that end it: what is there survives a start that fails, nothing that is
# printed lands in a file or a device, a full disk is told, and every signal brings the forces down.
set -u
: "${B:?the build directory}"
gloved=$B/gloved
tmp=$(mktemp -d); trap 'rm -rf "$tmp"' EXIT
fails=0
verdict() { # NAME CODE [WHY]
  if [ "$2" -eq 0 ]; then echo "ok $1"; else echo "  ${3:-}"; echo "FAIL $1"; fails=1; fi
}
cat > "$tmp/press.user" <<'END'
posture flat thumb_abduction 40
posture press like flat index_mpj 60
at 0.0 posture flat wrist -0.3 0 0.06 0 0 0 dead_man off
at 0.1 dead_man on
at 0.4 posture press
end 30
END
press=sim:$tmp/press.user

# Started without standard output: the recording gets frames and nothing else.
"$gloved" --fcu "$press" --lcm none --no-rt --duration 1 --record "$tmp/closed.log" >&- 2>&-
[ "$(grep -c '^(' "$tmp/closed.log")" -gt 500 ] && ! grep -qvE '^[(#]' "$tmp/closed.log"
verdict closed_standard_output_is_not_written_to_files $? "$(grep -vE '^[(#]' "$tmp/closed.log" | head -n 3)"

# keeps NAME FILE OPTION...: exit 2 (or 0 for --check), one line at most, and FILE still says "precious".
keeps() {
  name=$1 file=$2; shift 2
  echo precious > "$file"
  timeout 10 "$gloved" --lcm none --no-rt --duration 0.1 "$@" > "$tmp/out" 2> "$tmp/err"; code=$?
  [ "$code" -eq "$want" ] && [ "$(cat "$file")" = precious ]
  verdict "$name" $? "exit $code: $(cat "$tmp/err"); the file: $(head -c 60 "$file")"
}
want=0
keeps check_leaves_a_log_alone "$tmp/a.lcm" --check --fcu "$press" --log "$tmp/a.lcm"
keeps check_leaves_a_recording_alone "$tmp/a.log" --check --fcu "$press" --record "$tmp/a.log"
keeps check_leaves_a_summary_alone "$tmp/a.json" --check --fcu "$press" --summary "$tmp/a.json"
want=2
keeps failed_start_leaves_a_log_alone "$tmp/a.lcm" --fcu "trace:$tmp/none" --log "$tmp/a.lcm"
keeps failed_start_leaves_a_recording_alone "$tmp/a.log" --fcu "$press" --record "$tmp/a.log" --summary "$tmp/none/x.json"
keeps failed_start_leaves_a_summary_alone "$tmp/a.json" --fcu "$press" --summary "$tmp/a.json" --log "$tmp/none/x.lcm"
keeps one_file_for_two_options_is_refused "$tmp/same" --fcu "$press" --record "$tmp/same" --summary "$tmp/same"
ln -sf same "$tmp/link"
keeps one_file_by_a_link_is_refused "$tmp/same" --fcu "$press" --record "$tmp/same" --log "$tmp/link"
cp data/scenes/box.scene "$tmp/box.scene"
timeout 10 "$gloved" --lcm none --fcu "$press" --scene "$tmp/box.scene" --record "$tmp/box.scene" --duration 0.1 >"$tmp/out" 2>&1; code=$?
[ $code -eq 2 ] && cmp -s data/scenes/box.scene "$tmp/box.scene"; verdict a_recording_onto_the_scene_is_refused $? "exit $code: $(cat "$tmp/out")"

"$gloved" --fcu "$press?speed=0" --lcm none --duration 0.3 --record "$tmp/own.log" >/dev/null 2>&1
cp "$tmp/own.log" "$tmp/copy.log"
"$gloved" --fcu "trace:$tmp/own.log?speed=0" --lcm none --record "$tmp/own.log" > "$tmp/out" 2> "$tmp/err"; code=$?
[ $code -eq 2 ] && cmp -s "$tmp/own.log" "$tmp/copy.log"; verdict a_recording_onto_its_own_trace_is_refused $? "exit $code: $(cat "$tmp/err")"

mkfifo "$tmp/pipe"
for option in --record --log --summary; do
  for file in "$tmp/pipe" /dev/full; do
    timeout 5 "$gloved" --fcu "$press?speed=0" --lcm none --duration 0.1 "$option" "$file" > "$tmp/out" 2> "$tmp/err"; code=$?
    [ $code -eq 2 ] && grep -q 'name a plain file' "$tmp/err"; verdict "$(echo ${option#--}_to_${file##*/}_is_refused)" $? "exit $code: $(cat "$tmp/err")"
  done
done

# Nor are they waited for as what is read.
for input in "--config $tmp/pipe" "--scene $tmp/pipe" "--scene /dev/zero" "--fcu sim:$tmp/pipe" "--fcu trace:$tmp/pipe" "--fcu trace:/dev/zero"; do
  timeout 5 "$gloved" --check --lcm none $input > "$tmp/out" 2> "$tmp/err"; code=$?
  [ $code -eq 2 ] && grep -q 'plain file' "$tmp/err"; verdict "$(echo "$input" | sed "s,$tmp/,,; s/^--//; s/[^a-z]/_/g")_is_not_read" $? "exit $code: $(cat "$tmp/err")"
done

cp "$tmp/press.user" "$tmp/precious.user"
timeout 10 "$gloved" --lcm none --fcu "sim:$tmp/precious.user" --record "$tmp/precious.user" --duration 0.1 > "$tmp/out" 2>&1; code=$?
[ $code -eq 2 ] && cmp -s "$tmp/press.user" "$tmp/precious.user"; verdict a_recording_onto_its_own_script_is_refused $? "exit $code: $(cat "$tmp/out")"
cp "$tmp/own.log.about" "$tmp/copy.about"
timeout 10 "$gloved" --lcm none --fcu "trace:$tmp/own.log?speed=0" --summary "$tmp/own.log.about" > "$tmp/out" 2>&1; code=$?
[ $code -eq 2 ] && cmp -s "$tmp/own.log.about" "$tmp/copy.about"; verdict a_summary_onto_the_traces_own_words_is_refused $? "exit $code: $(cat "$tmp/out")"
ln -s nowhere "$tmp/dangling"
timeout 10 "$gloved" --check --lcm none --fcu "$press" --record "$tmp/dangling" > "$tmp/out" 2>&1; code=$?
[ $code -eq 2 ] && [ -L "$tmp/dangling" ] && [ ! -e "$tmp/nowhere" ]; verdict a_link_to_nothing_stays $? "exit $code: $(cat "$tmp/out")"

# A disk without room: the start is refused, and what is there stays.
for file in log lcm json log.about; do echo precious > "$tmp/old.$file"; done
(ulimit -f 0; exec timeout 10 "$gloved" --lcm none --fcu "$press" --record "$tmp/old.log" --log "$tmp/old.lcm" --summary "$tmp/old.json" --duration 0.1) > /dev/null 2> /dev/null; code=$?
[ $code -eq 2 ] && [ "$(sort -u "$tmp/old.log" "$tmp/old.lcm" "$tmp/old.json" "$tmp/old.log.about")" = precious ] && [ ! -e "$tmp/old.log.about.part" ]
verdict a_full_disk_at_the_start_leaves_all_alone $? "exit $code: $(head -c 30 "$tmp/old".*)"

# A disk with room for 200 kB.
for option in --record --log; do
  (ulimit -f 400; exec timeout 20 "$gloved" --fcu "$press?speed=0" --lcm none --duration 8 "$option" "$tmp/large") > "$tmp/out" 2> "$tmp/err"; code=$?
  [ $code -eq 2 ] && grep -q 'make room' "$tmp/err"; verdict "${option#--}_on_a_full_disk_is_told" $? "exit $code: $(cat "$tmp/err")"
  rm -f "$tmp/large"
done

# Whatever ends it: a ramp, zero, and the summary.
for signal in HUP INT QUIT USR1 USR2 ALRM VTALRM PROF XCPU XFSZ TERM; do
  "$gloved" --fcu "$press" --lcm none --no-rt --summary "$tmp/end.json" > "$tmp/out" 2> "$tmp/err" & pid=$!
  for i in $(seq 100); do grep -q 'armed -> active' "$tmp/out" && break; sleep 0.05; done
  sleep 0.1; kill -"$signal" "$pid"; wait "$pid"; code=$?
  [ $code -eq 0 ] && grep -q '"exit_reason": "signal"' "$tmp/end.json" && grep -qF '"force_final_n": [0, 0, 0, 0, 0]' "$tmp/end.json"
  verdict "signal_${signal}_ends_with_zero_force" $? "exit $code: $(cat "$tmp/err")"
done
exit $fails
