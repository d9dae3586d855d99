#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# The daemon from outside: every wrong option ends with exit code 2 and one line that names the bad thing and
# says what to do; --check, --help, the keys of --summary, and SIGTERM while a force flows.
set -u
: "${B:?the build directory}"
gloved=$B/gloved
tmp=$(mktemp -d); trap 'rm -rf "$tmp"' EXIT
fails=0
verdict() { # NAME CODE [WHY]
  if [ "$2" -eq 0 ]; then echo "ok $1"; else echo "  ${3:-}"; echo "FAIL $1"; fails=1; fi
}

# A user who presses a finger onto the table and stays there.
cat > "$tmp/press.user" <<'END'
posture flat thumb_abduction 40
posture press like flat index_mpj 60
at 0.0 posture flat wrist -0.3 0 0.06 0 0 0 dead_man off
at 0.1 dead_man on
at 0.4 posture press
end 30
END
press=sim:$tmp/press.user
printf '(0.000000) can0 110##1zz\n' > "$tmp/broken.log"
printf '(0.000000) can0 123#00\n' > "$tmp/empty.log"

# refused NAME WORD OPTION...: exit 2, nothing on stdout, one line on stderr that contains WORD and advice.
refused() {
  name=refused_$1 word=$2; shift 2
  timeout 10 "$gloved" "$@" > "$tmp/out" 2> "$tmp/err"; code=$?
  lines=$(wc -l < "$tmp/err")
  [ "$code" -eq 2 ] && [ "$lines" -eq 1 ] && [ ! -s "$tmp/out" ] && grep -qF -e "$word" "$tmp/err" && grep -q '[;(]' "$tmp/err"
  verdict "$name" $? "exit $code, $lines lines: $(cat "$tmp/err")"
}
refused unknown_option --bogus --bogus
refused stray_word stray stray
refused missing_value --scene --scene
refused value_that_is_an_option --scene --scene --check
refused rate_word '"fast"' --rate fast
refused rate_low '5 ' --rate 5
refused rate_high 20000 --rate 20000
refused rate_not_a_number nan --rate nan
refused rate_trailing 1000x --rate 1000x
refused narrow_word 'give core or libccd' --narrow gjk
refused solver_old_word 'newton' --solver quick
refused solver_unknown 'auto, newton, dantzig or quickstep' --solver pgs
refused duration_zero '--duration 0' --duration 0
refused duration_negative '-3' --duration -3
refused duration_infinite inf --duration inf
refused config_missing "$tmp/no.conf" --config "$tmp/no.conf"
refused scene_missing "$tmp/no.scene" --scene "$tmp/no.scene"
refused scene_directory "$tmp" --scene "$tmp"
refused fcu_kind gopher: --fcu gopher:x
refused fcu_empty --fcu --fcu ''
refused fcu_can_name 'can:IFACE' --fcu can:
refused fcu_can_absent 'can:nocan7' --fcu can:nocan7
refused glove_alone 'add --tracker' --fcu 'serial:/dev/null?type=cyberglove'
refused glove_no_tty 'give a serial device' --fcu 'serial:/dev/null?type=cyberglove' --tracker 'serial:/dev/null?type=fastrak'
refused glove_no_type 'no type of device' --fcu 'serial:/dev/null' --tracker 'serial:/dev/null?type=fastrak'
refused glove_is_tracker 'give it as --tracker' --fcu 'serial:/dev/null?type=fastrak' --tracker 'serial:/dev/null?type=fastrak'
refused tracker_no_tty 'give a serial device' --tracker 'serial:/dev/null?type=fastrak'
refused tracker_unknown 'no such tracker' --tracker 'serial:/dev/null?type=liberty'
refused tracker_too_fast 'speed=0' --fcu 'sim:?speed=0' --tracker 'serial:/dev/null?type=fastrak'
refused trace_missing "$tmp/no.log" --fcu "trace:$tmp/no.log"
refused trace_broken "$tmp/broken.log:1" --fcu "trace:$tmp/broken.log"
refused trace_without_glove "$tmp/empty.log" --fcu "trace:$tmp/empty.log"
refused trace_speed speed --fcu "trace:$tmp/empty.log?speed=7"
refused sim_script "$tmp/no.user" --fcu "sim:$tmp/no.user"
refused sim_setting bogus --fcu "sim:$tmp/press.user?bogus=1"
refused udp_port listen --fcu 'udp://127.0.0.1:5000'
refused lcm_provider bogus://x --fcu "$press" --lcm bogus://x
refused lcm_port 99999 --fcu "$press" --lcm 'udpm://239.255.76.67:99999'
refused log_place "$tmp/no/x.lcm" --fcu "$press" --lcm none --log "$tmp/no/x.lcm"
refused record_place "$tmp/no/x.log" --fcu "$press" --lcm none --record "$tmp/no/x.log"
refused json_alone --doctor --json
refused sync_word '"glove"' --sync glove
refused summary_place "$tmp/no/x.json" --fcu "$press" --lcm none --summary "$tmp/no/x.json"

"$gloved" --help > "$tmp/help"; code=$?
for option in --config --scene --fcu --tracker --rate --narrow --solver --duration --lcm --log --record --summary --no-rt --strict --sync --doctor --json --check --print-config --help --version; do
  grep -q -e "$option" "$tmp/help" || code=1
done
verdict help_names_every_option $code "$(cat "$tmp/help")"
for tool in gloved fcusim serialsim gloved-trace gloved-calibrate; do
  [ "$("$B/$tool" --help | wc -l)" -gt 0 ]; verdict "help_of_$tool" $?
done
# From any folder, at once, on standard output, without a package that is not there.
here=$(pwd)
for tool in $(find "$here/tools" "$here/test" -type f -perm -u+x ! -name init ! -name tap); do
  name=${tool#"$here/"}
  (cd / && timeout 5 "$tool" --help < /dev/null > "$tmp/out" 2> "$tmp/err"); code=$?
  [ $code -eq 0 ] && [ ! -s "$tmp/err" ] && grep -q "^$(basename "$tool")" "$tmp/out" && [ "$(wc -l < "$tmp/out")" -le 48 ]
  verdict "help_of_$name" $? "exit $code: $(head -n 3 "$tmp/out" "$tmp/err")"
done
"$gloved" --version | grep -qE '^gloved [0-9]+\.[0-9]+'; verdict version $?

# tools/packages waits where another apt holds a lock, and says at once what else went wrong.
mkdir -p "$tmp/bin"
printf '#!/bin/sh\nexit 1\n' > "$tmp/bin/dpkg-query"
printf '#!/bin/sh\n' > "$tmp/bin/sleep"
printf '#!/bin/sh\nexec "$@"\n' > "$tmp/bin/sudo"
cat > "$tmp/bin/apt-get" <<'END'
#!/bin/sh
echo call >> "$CALLS"
[ "$(wc -l < "$CALLS")" -gt "$LOCKED" ] && exit "$THEN"
echo 'E: Could not get lock /var/lib/apt/lists/lock. It is held by process 1 (apt-get)'
exit 100
END
chmod +x "$tmp"/bin/*
CALLS=$tmp/calls LOCKED=3 THEN=0 PATH=$tmp/bin:$PATH tools/packages no-such-package > "$tmp/out" 2>&1; code=$?
[ $code -eq 0 ] && [ "$(wc -l < "$tmp/calls")" -eq 4 ] && grep -q 'waits for another apt' "$tmp/out"
verdict packages_waits_for_another_apt $? "exit $code: $(cat "$tmp/out")"
rm -f "$tmp/calls"
CALLS=$tmp/calls LOCKED=0 THEN=100 PATH=$tmp/bin:$PATH tools/packages no-such-package > "$tmp/out" 2>&1; code=$?
[ $code -eq 1 ] && [ "$(wc -l < "$tmp/calls")" -eq 2 ]; verdict packages_does_not_wait_for_what_never_comes $? "exit $code: $(cat "$tmp/out")"

# gloved-command says what is wrong with which word, before it asks anybody.
command_refused() { # NAME WORDS... (the last: what standard error must say)
  name=$1; shift
  for last; do :; done
  said=$("$B/gloved-command" ${1:+"$1"} ${3:+"$2"} ${4:+"$3"} 2>&1 >/dev/null); code=$?
  [ $code -eq 2 ] && [ "$(printf '%s\n' "$said" | wc -l)" -eq 1 ] && printf %s "$said" | grep -qF "$last"
  verdict "command_$name" $? "exit $code: $said"
}
command_refused unknown bogus 'bogus: no such command; give reset, scene,'
command_refused not_a_number coupling much 'coupling much: not a number; give a multiple, 0.1 to 2'
command_refused argument_missing friction 'friction needs a coefficient, 0 to 2'
command_refused argument_too_many disarm now 'now: nothing more was expected after disarm'

"$gloved" --check --fcu "$press" --lcm none --summary "$tmp/check.json" > "$tmp/out" 2> "$tmp/err"; code=$?
[ "$code" -eq 0 ] && [ ! -s "$tmp/err" ] && [ ! -e "$tmp/check.json" ] && grep -q 'box.scene; 2 objects' "$tmp/out" && ! grep -q steps "$tmp/out"
verdict check_says_what_it_found $? "exit $code: $(cat "$tmp/out" "$tmp/err")"

# A mass in grams: sound to the loader, hardly meant.
sed 's/mass = 0.2;/mass = 200.0;/' data/scenes/box.scene > "$tmp/grams.scene"
"$gloved" --check --scene "$tmp/grams.scene" --fcu "$press" --lcm none > "$tmp/out" 2> "$tmp/err"; code=$?
[ "$code" -eq 0 ] && grep -q '^warning .*grams taken as kilograms' "$tmp/out" && grep -q '^warning .*sinks by' "$tmp/out" && ! grep -q 'all sound' "$tmp/out"
verdict check_doubts_a_mass_in_grams $? "exit $code: $(cat "$tmp/out" "$tmp/err")"

"$gloved" --doctor > "$tmp/out" 2> "$tmp/err"; words=$?
"$gloved" --doctor --json > "$tmp/doctor.json" 2>> "$tmp/err"; code=$?
python3 - "$tmp/doctor.json" "$code" <<'END' > "$tmp/why" 2>&1
import json, sys
report = json.load(open(sys.argv[1]))
order = ["PASS", "WARN", "FAIL"]
worst = max((c["verdict"] for c in report["checks"]), key=order.index)
assert len(report["checks"]) >= 14 and report["worst"] == worst == order[int(sys.argv[2])], report
assert all(c["found"] and bool(c["mend"]) == (c["verdict"] != "PASS") for c in report["checks"]), report
END
[ $? -eq 0 ] && [ "$words" -eq "$code" ] && [ ! -s "$tmp/err" ] && [ "$(grep -cE '^(PASS|WARN|FAIL) ' "$tmp/out")" -ge 14 ]
verdict doctor_says_the_worst_in_its_exit_code $? "exit $words and $code: $(cat "$tmp/why" "$tmp/err" "$tmp/out")"

printf 'version = 1;\nlimiter = { ramp_s = 0.03; };\n' > "$tmp/lax.conf"
"$gloved" --config "$tmp/lax.conf" --fcu "$press?speed=0" --lcm none --duration 0.1 --summary "$tmp/lax.json" > "$tmp/out" 2> "$tmp/err" &&
  grep -qF 'less than the defaults (in brackets): limiter.ramp_s 0.03 (0.015)' "$tmp/err" && grep -qF 'limiter.ramp_s 0.03 (0.015)' "$tmp/out" &&
  grep -qF '"laxer_than_default": "limiter.ramp_s 0.03 (0.015)"' "$tmp/lax.json"
verdict laxer_than_the_default_is_said_at_every_start $? "$(cat "$tmp/err" "$tmp/out")"

"$gloved" --fcu 'sim:data/scripts/power_box.user?speed=0' --lcm none --summary "$tmp/held.json" > "$tmp/out" 2> "$tmp/err" &&
  tail -n 1 "$tmp/out" | grep -qE '^  box was held for 9\.[0-9] s, up to 14[0-9] mm above its place: it moved 0\.0[0-9]+ mm in the hand$' &&
  ! grep -qE -e '-0(\.0*)?( |$)' "$tmp/out" &&
  python3 -c 'import json, sys; o = json.load(open(sys.argv[1]))["objects"][1]; assert 9 < o["held_s"] < 10 and 0 < o["moved_in_hand_m"] < 1e-4, o' "$tmp/held.json" 2>> "$tmp/err"
verdict a_run_ends_on_what_the_hand_held $? "$(tail -n 1 "$tmp/out"; cat "$tmp/err")"

printf 'version = 1;\nrate_hz = 500.0;\nlcm = "none";\n' > "$tmp/rate.conf"
"$gloved" --config "$tmp/rate.conf" --check --fcu "$press" > "$tmp/out" 2>&1 && grep -q ' 500 Hz, step 2 ms' "$tmp/out"
verdict config_over_defaults $? "$(cat "$tmp/out")"
"$gloved" --config "$tmp/rate.conf" --rate 2000 --check --fcu "$press" > "$tmp/out" 2>&1 && grep -q '2000 Hz, step 0.5 ms' "$tmp/out"
verdict command_line_over_config $? "$(cat "$tmp/out")"

# Where to publish: the option, the configuration, the environment, in this order.
url() { LCM_DEFAULT_URL=memq://environment "$gloved" --check --fcu "$press" "$@" 2> /dev/null | sed -n 's/^lcm *//p'; }
[ "$(url)" = memq://environment ] && [ "$(url --lcm none)" = none ] && [ "$(url --config "$tmp/rate.conf")" = none ]
verdict lcm_url_of_the_environment $? "$(url) $(url --lcm none) $(url --config "$tmp/rate.conf")"

"$gloved" --solver dantzig --check --fcu "$press" --lcm none > "$tmp/out" 2>&1 && grep -q 'solver dantzig, narrow phase core' "$tmp/out"
verdict check_says_the_solver $? "$(cat "$tmp/out")"
for solver in newton dantzig quickstep; do
  "$gloved" --solver $solver --fcu 'sim:data/scripts/power_box.user?speed=0' --lcm none --duration 6 --summary "$tmp/solver.json" > /dev/null 2> "$tmp/err"
  python3 -c 'import json, sys; n = json.load(open(sys.argv[1]))["solver_steps"]; sys.exit(not (n[sys.argv[2]] > 1000 and n["newton"] + n["dantzig"] + n["quickstep"] + n["none"] == n[sys.argv[2]]))' "$tmp/solver.json" $solver
  verdict summary_says_${solver}_did_the_steps $? "$(grep solver_steps "$tmp/solver.json"; cat "$tmp/err")"
done

"$gloved" --fcu "$press?speed=0" --lcm none --duration 0.5 --summary "$tmp/free.json" > "$tmp/out" 2> "$tmp/err"; code=$?
python3 - "$tmp/free.json" <<'END' > "$tmp/why" 2>&1
import json, math, re, sys
s = json.load(open(sys.argv[1]))
assert s["steps"] == 500, s["steps"]
assert re.fullmatch("[0-9a-f]{16}", s["state_hash"]), s["state_hash"]
for key in ("missed_deadlines", "overruns", "contacts_max", "contacts_dropped", "rt_heap_calls"):
    assert isinstance(s[key], int) and s[key] >= 0, key
assert s["rt_heap_calls"] == 0 and s["rt_page_faults"] == {"major": 0, "minor": 0}, s["rt_page_faults"]
for key in ("step_us", "wake_us"):
    q = s[key]
    assert set(q) == {"p50", "p99", "p999", "max"} and q["p50"] <= q["p99"] <= q["p999"] <= q["max"], q
assert 0 < s["step_us"]["p50"] and 0 <= s["depth_max_m"] < 0.1
assert len(s["force_max_n"]) == 5 and s["force_max_n"][1] > 0.1, s["force_max_n"]
assert {"rx", "tx", "lost", "bad", "late"} <= set(s["frames"]) and s["frames"]["rx"] > 500
assert s["ladder"] == dict(full=0, solver=0, contacts=0, hold=0, ramp=0), "the deadline ladder acts in a replay"
assert s["state"] == "active" and s["exit_reason"] == "duration", (s["state"], s["exit_reason"])
box = {o["name"]: o for o in s["objects"]}["box"]
assert max(abs(a - b) for a, b in zip(box["position"], [0, 0, 0.04])) < 1e-3, box
assert abs(math.hypot(*box["quaternion"]) - 1) < 1e-12
END
verdict summary_has_every_key $((code || $?)) "exit $code: $(cat "$tmp/why" "$tmp/err")"
[ ! -s "$tmp/err" ] && grep -q 'state hash' "$tmp/out" && ! grep -q 'hand placed' "$tmp/out"
verdict free_replay_prints_the_summary_alone $? "$(cat "$tmp/out" "$tmp/err")"

"$gloved" --fcu "$press" --lcm none --duration 0.5 --summary "$tmp/paced.json" > /dev/null 2>&1
"$gloved" --fcu "$press" --lcm none --duration 0.5 --no-rt --summary "$tmp/no-rt.json" > /dev/null 2>&1
hashes=$(grep -h state_hash "$tmp/free.json" "$tmp/paced.json" "$tmp/no-rt.json" | sort -u | wc -l)
[ "$hashes" -eq 1 ]; verdict hash_knows_no_clock $? "$(grep -h state_hash "$tmp"/*.json)"

# --record: what a run kept replays to the same bits, also as an ordinary log; a run that is killed leaves a log.
hash_of() { sed -n 's/.*"state_hash": "\(.*\)".*/\1/p' "$1"; }
"$gloved" --fcu "$press?speed=0" --lcm none --duration 0.7 --record "$tmp/free.log" --summary "$tmp/free.json" > /dev/null 2>&1
"$gloved" --fcu "trace:$tmp/free.log?speed=0" --lcm none --summary "$tmp/again.json" > "$tmp/out" 2>&1
[ -n "$(hash_of "$tmp/free.json")" ] && [ "$(hash_of "$tmp/free.json")" = "$(hash_of "$tmp/again.json")" ] && [ "$(grep -c ' 090##' "$tmp/free.log")" -ge 700 ]
verdict record_replays_to_the_same_state $? "$(hash_of "$tmp/free.json") $(hash_of "$tmp/again.json")"
"$gloved" --fcu "$press" --lcm none --record "$tmp/killed.log" > /dev/null 2>&1 & pid=$!
for i in $(seq 100); do [ "$(grep -c ' 110##' "$tmp/killed.log" 2>/dev/null)" -ge 300 ] && break; sleep 0.05; done
kill -KILL "$pid"; wait "$pid" 2>/dev/null
"$gloved" --fcu "trace:$tmp/killed.log?speed=0" --lcm none --summary "$tmp/killed.json" > "$tmp/out" 2>&1 && grep -qE '"steps": [0-9]{3}' "$tmp/killed.json"
verdict a_killed_run_leaves_a_readable_record $? "$(cat "$tmp/out")"

"$gloved" --fcu "$press?glove_hz_min=12&glove_hz_max=12&speed=0" --lcm none --duration 0.5 --summary "$tmp/fault.json" > "$tmp/out" 2> "$tmp/err"; code=$?
[ "$code" -eq 1 ] && grep -q 'fault: glove data too old' "$tmp/err" && grep -q '"exit_reason": "fault"' "$tmp/fault.json" && grep -qF '"force_final_n": [0, 0, 0, 0, 0]' "$tmp/fault.json"
verdict fault_is_exit_code_1 $? "exit $code: $(cat "$tmp/err" "$tmp/out")"

"$gloved" --fcu "$press" --lcm none --summary "$tmp/term.json" > "$tmp/out" 2> "$tmp/err" & pid=$!
for i in $(seq 100); do grep -q 'armed -> active' "$tmp/out" && break; sleep 0.05; done
sleep 0.2; kill -TERM "$pid"; wait "$pid"; code=$?
python3 - "$tmp/term.json" <<'END' > "$tmp/why" 2>&1
import json, sys
s = json.load(open(sys.argv[1]))
assert s["exit_reason"] == "signal" and s["state"] == "active", (s["exit_reason"], s["state"])
assert s["force_max_n"][1] > 0.1 and s["force_final_n"] == [0, 0, 0, 0, 0], (s["force_max_n"], s["force_final_n"])
assert s["frames"]["tx"] >= s["steps"] + 3
END
verdict sigterm_ends_with_zero_force $((code || $?)) "exit $code: $(cat "$tmp/why" "$tmp/err" "$tmp/out")"
exit $fails
