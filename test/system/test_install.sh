#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# make install into an empty tree: the programs find their data from any folder, every program answers --help and
# --version, the library exports gv_ names alone, the examples in C, C++ and Python build against it, the daemon talks to
# a service manager; make uninstall leaves nothing.
set -u
here=$(pwd)
: "${B:?the build directory}"
case ${PYTHON:=build/venv/bin/python} in /*) python=$PYTHON ;; *) python=$(pwd)/$PYTHON ;; esac
tmp=$(mktemp -d); trap 'rm -rf "$tmp"' EXIT
fails=0
verdict() { # NAME CODE [WHY]
  if [ "$2" -eq 0 ]; then echo "ok $1"; else echo "  ${3:-}"; echo "FAIL $1"; fails=1; fi
}
root=$tmp/root prefix=/opt/gloved
tree=$root$prefix
make --no-print-directory B="$B" DESTDIR="$root" PREFIX="$prefix" install > "$tmp/log" 2>&1
verdict install $? "$(tail -n 5 "$tmp/log")"

cd /
"$tree/bin/gloved" --check --lcm none > "$tmp/out" 2>&1 && grep -q 'all sound' "$tmp/out"
verdict defaults_are_found_from_any_folder $? "$(cat "$tmp/out")"
"$tree/bin/gloved" --lcm none --no-rt --scene frame --fcu 'sim:bar_frame?speed=0' --duration 0.2 > "$tmp/out" 2>&1
verdict bare_names_are_found $? "$(cat "$tmp/out")"
"$tree/bin/gloved" --check --lcm none --scene nowhere > "$tmp/out" 2>&1; code=$?
[ $code -eq 2 ] && grep -q '^gloved: nowhere: ' "$tmp/out"; verdict an_error_names_what_was_written $? "exit $code: $(cat "$tmp/out")"

for program in "$tree"/bin/*; do
  name=$(basename "$program")
  "$program" --version > "$tmp/out" 2> "$tmp/err"; code=$?
  [ $code -eq 0 ] && [ "$(wc -l < "$tmp/out")" -eq 1 ] && grep -qE "^$name [0-9.]+ \([0-9a-f]{7,}\+?\)\$" "$tmp/out" && [ ! -s "$tmp/err" ]
  verdict "version_of_$name" $? "exit $code: $(cat "$tmp/out" "$tmp/err")"
  completion=$tree/share/bash-completion/completions/$name
  [ -s "$completion" ] && bash -c '. "$1"; complete -p "$2"' - "$completion" "$name" > /dev/null 2>&1; verdict "completion_of_$name" $?
  page=$tree/share/man/man1/$name.1
  [ "$(sed -n '/^.SH NAME/{n;p;q}' "$page" | tr -d '\\' | cut -d' ' -f-2)" = "$name -" ] && [ "$(grep -c '^\.SH' "$page")" -ge 3 ]
  verdict "manual_of_$name" $? "$(head -n 5 "$page")"
  "$program" --help > "$tmp/out" 2> "$tmp/err"; code=$?
  [ $code -eq 0 ] && [ "$(wc -l < "$tmp/out")" -ge 3 ] && [ "$(wc -l < "$tmp/out")" -le 48 ] && [ ! -s "$tmp/err" ] && ! grep -qE '.{121}' "$tmp/out"
  verdict "help_of_$name" $? "exit $code: $(cat "$tmp/err"; grep -E '.{121}' "$tmp/out")"
done

# What a script written in Python takes is what its --help, which needs no package, lists.
for script in gloved-plot:gloved_plot.py gloved-look:look.py gloved-scene:mesh/scene.py; do
  name=${script%%:*} missing=
  "$tree/bin/$name" --help > "$tmp/out"
  for option in $(grep -oE 'add_argument\("--[a-z-]+' "$tree/lib/gloved/tools/${script#*:}" | cut -d'"' -f2); do
    grep -q -e "$option" "$tmp/out" || missing="$missing $option"
  done
  [ -z "$missing" ]; verdict "help_of_${name}_has_every_option" $? "tools/$name does not tell:$missing"
done

nm -D --defined-only "$tree/lib/libgloved.so" | awk '{print $3}' > "$tmp/names"
[ "$(grep -c '^gv_' "$tmp/names")" -gt 50 ] && ! grep -qv '^gv_' "$tmp/names"; verdict shared_library_exports_gv_alone $? "$(grep -v '^gv_' "$tmp/names" | head -n 5)"
nm -g --defined-only "$tree/lib/libgloved.a" | awk 'NF == 3 {print $3}' > "$tmp/names"
[ "$(grep -c '^gv_' "$tmp/names")" -gt 50 ] && ! grep -qv '^gv_' "$tmp/names"; verdict static_library_exports_gv_alone $? "$(grep -v '^gv_' "$tmp/names" | head -n 5)"

# The examples: the same state hash three times.
sed -i "s,^prefix=.*,prefix=$tree," "$tree/lib/pkgconfig/gloved.pc"
flags="-I$tree/include -L$tree/lib -lgloved"
cd "$tmp"
cc -std=c11 -Wall -Wextra -Wpedantic -Werror "$tree/share/gloved/examples/hold.c" $flags -o hold-shared > out 2>&1 &&
  LD_LIBRARY_PATH=$tree/lib ./hold-shared "$tree/share/gloved/scenes/box.scene" > shared 2>&1
verdict example_in_c $? "$(cat out shared)"
awk '{for (i = 5; i <= 8; i++) if (!($i > 0.1 && $i < 2)) exit 1}' shared; verdict the_example_feels_the_box $? "$(cat shared)"
cc -std=c11 "$tree/share/gloved/examples/hold.c" -I"$tree/include" "$tree/lib/libgloved.a" -lode -lccd -lconfig -lm -o hold-static > out 2>&1 &&
  ./hold-static "$tree/share/gloved/scenes/box.scene" > static 2>&1 && cmp shared static
verdict example_with_the_static_library $? "$(cat out static)"
for h in "$tree"/include/gloved/*.h; do echo "#include <gloved/$(basename "$h")>"; done > all.cc
echo 'int main() { return gv_config_check(nullptr) == nullptr && false; }' >> all.cc
if command -v g++ >/dev/null; then
  g++ -std=c++17 -c all.cc -I"$tree/include" -o all.o > out 2>&1 && nm all.o | grep -q ' U gv_config_check'
  verdict headers_in_cplusplus $? "$(head -n 5 out)"
else
  echo "skip headers_in_cplusplus: no g++ on this machine; apt-get install g++"
fi
if command -v pkg-config >/dev/null && "$python" -c 'import cffi, setuptools' 2>/dev/null; then
  PKG_CONFIG_PATH=$tree/lib/pkgconfig LD_LIBRARY_PATH=$tree/lib "$python" "$tree/share/gloved/examples/hold.py" "$tree/share/gloved/scenes/box.scene" > py 2> out
  [ "$(tail -n 1 py)" = "$(cat shared)" ]; verdict example_in_python $? "$(tail -n 1 py; cat shared; tail -n 3 out)"
else
  echo "skip example_in_python: no pkg-config or no cffi; make test installs both"
fi

# A service manager: READY, signs of life while the loop steps, STOPPING.
"$python" - "$tree/bin/gloved" "$tmp/notify" > out 2>&1 <<'END'
import os, socket, subprocess, sys
s = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
s.bind(sys.argv[2])
s.settimeout(5)
env = dict(os.environ, NOTIFY_SOCKET=sys.argv[2], WATCHDOG_USEC="400000")
p = subprocess.Popen([sys.argv[1], "--lcm", "none", "--no-rt", "--duration", "2"], env=env, stdout=subprocess.DEVNULL)
said = []
while "STOPPING=1" not in said:
    said += s.recv(1000).decode().split("\n")
assert p.wait() == 0
assert said[0] == "READY=1" and "STATUS=ready" in said, said
assert 4 <= said.count("WATCHDOG=1") <= 60, said
END
verdict a_service_manager_is_told $? "$(tail -n 2 out)"
if command -v systemd-analyze >/dev/null; then
  systemd-analyze security --offline=true "$tree/lib/systemd/system/gloved.service" > out 2>&1
  echo "figure exposure of the service by systemd-analyze security: $(sed -n 's/.*exposure level[^:]*: *//p' out)"
fi
cd "$here"
make --no-print-directory B="$B" DESTDIR="$root" PREFIX="$prefix" uninstall > "$tmp/log" 2>&1
left=$(find "$root" -type f -o -type l)
[ -z "$left" ]; verdict uninstall_leaves_nothing $? "$left"

# An archive unpacked inside a clone (as `make deb` does): git answers there, with no file of its own.
if git rev-parse HEAD >/dev/null 2>&1; then
  mkdir -p "$tmp/clone/archive" && git init -q "$tmp/clone" && cp -r Makefile data "$tmp/clone/archive/"
  make --no-print-directory -C "$tmp/clone/archive" -s list-data > "$tmp/listed" 2>"$tmp/err"
  grep -q '^data/scenes/box.scene$' "$tmp/listed"; verdict an_archive_in_a_clone_has_its_data $? "$(cat "$tmp/err"; head -n 3 "$tmp/listed")"
fi
exit $fails
