#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# guest.sh DIR - runs in the guest of tools/uml-can: fcusim and gloved on real CAN interfaces, one experiment after
# the other. What they say goes to DIR (test/can/judge.py reads it there); nothing is judged here.
set -u
: "${B:?the build directory}"
out=$1
device_options='--duration 3'
log=/tmp/can; mkdir -p $log; cd "$(dirname "$0")/../.."

# engine NAME [OPTION...]: gloved in the background, under its list of system calls.
engine() {
  name=$1; shift
  "$B/gloved" --strict --config test/can/slow.conf --no-rt --summary $log/$name.json "$@" >$log/$name.gloved 2>&1 & engine=$!
}
# begin NAME IFACE SCRIPT SECONDS [OPTION of gloved...], then finish: both, until the script is over; or stop.
begin() {
  name=$1 iface=$2 script=$3 seconds=$4; shift 4
  engine "$name" --fcu "can:$iface" --duration "$seconds" "$@"
  "$B/fcusim" --can "$iface" --script "test/can/$script.user" $device_options --report $log/$name.fcusim.json >$log/$name.fcusim 2>&1 & device=$!
}
stop() { kill $device; finish; }
finish() { wait $device; echo $? >$log/$name.fcusim.code; kill $engine 2>/dev/null; wait $engine; echo $? >$log/$name.code; }
# await WORDS SECONDS [COUNT]: waits until gloved said the words (so many times), then that long.
await() {
  for _ in $(seq 200); do [ "$(said "$1")" -ge "${3:-1}" ] && break; sleep 0.05; done
  sleep "$2"
}
said() { grep -c "$1" $log/$name.gloved; }
# The wire is dead until the engine notices; then `ip ...` brings it back, and it must be ready once more.
until_ready_again() {
  times=$(said 'wait -> ready'); await 'too old\|ready -> wait' 0.1
  "$@"
  await 'wait -> ready' 0.3 $((times + 1)); stop
}
make_vcan0() { ip link add dev vcan0 type vcan && ip link set vcan0 mtu 72 up; }
make_classic() { ip link set vcan0 mtu 16 up; }
replay() { "$B/gloved" --config test/can/slow.conf --fcu "trace:$log/$1?speed=0" --summary $log/$2.json >$log/$2.gloved 2>&1; echo $? >$log/$2.code; }

# A whole grasp, kept by candump and by gloved itself; then the recordings, as fast as possible and over the bus.
candump -L vcan0 >$log/candump.log & dump=$!
device_options=
begin grasp vcan0 grasp 20 --record $log/record.log
finish
kill $dump
grep -v ' 090#' $log/candump.log >$log/device.log
replay record.log record
"$B/gloved-trace" align $log/candump.log -o $log/aligned.log --rate 500 >$log/align 2>&1
replay aligned.log aligned
replay candump.log candump
engine canplayer --fcu can:vcan0 --duration 20
await 'start -> wait' 0; canplayer -I $log/device.log; sleep 0.7; kill $engine; wait $engine; echo $? >$log/canplayer.code

# What a bad link does. vcan has echo=1: what one side sends passes netem on its way to the other.
device_options='--duration 3'
for fault in 'loss 3%' 'duplicate 5%' 'delay 3ms 2ms' 'corrupt 5%'; do
  tc qdisc add dev vcan0 root netem $fault
  begin "netem_${fault%% *}" vcan0 press 20
  finish
  tc qdisc del dev vcan0 root
done

# The cable: down and up, removed and made again, while a force flows; then the same hand presses again.
device_options=
begin down vcan0 press 20
await 'armed -> active' 0.3; ip link set vcan0 down
until_ready_again ip link set vcan0 up
begin removed vcan0 press 20
await 'armed -> active' 0.3; ip link del vcan0
until_ready_again make_vcan0
device_options='--device wire_count_n=0.012'
begin changed vcan0 press 20
await 'armed -> active' 0.3; ip link set vcan0 down
until_ready_again make_classic
ip link set vcan0 down; ip link set vcan0 mtu 72 up

# The guest's time of day jumps while a force flows.
device_options='--duration 3'
begin clock vcan0 press 20
await 'armed -> active' 0.2; date -s '+1 hour' >/dev/null; sleep 0.2; date -s '-2 hours' >/dev/null
finish

# A full queue, error frames, a reader that does not read.
tc qdisc add dev vcan0 root netem delay 40ms limit 8
device_options='--duration 1.5'
begin full vcan0 press 20
finish
tc qdisc del dev vcan0 root
device_options=
begin flood vcan0 press 20
await 'wait -> ready' 0.5; for _ in 1 2 3; do cansend vcan0 20000004#0000000000000000; done
kill -STOP $engine; cangen vcan0 -I 110 -L 48 -f -g 0 -n 3000; sleep 1.2; kill -CONT $engine; await 'too old\|overran' 0.2
stop

# The reference gateway on CAN: its hand bends a finger onto the table.
engine gateway --fcu can:vcan0 --duration 9
"$B/gateway" --can vcan0 --duration 11 >$log/gateway.said 2>&1
wait $engine; echo $? >$log/gateway.code

# Through a real cannelloni, where there is one: fcusim on the bus, gloved behind UDP; the second time the bridge stands
# still for 20 ms ten times while a force flows, and so sends what it kept in an order of its own.
bridge() {
  LD_LIBRARY_PATH=$(dirname "$CANNELLONI") "$CANNELLONI" -I "$1" -R 127.0.0.1 -r 20000 -l 20001 -t 1000 >$log/cannelloni.bridge 2>&1 & bridge=$!
  sleep 0.3
}
behind_udp='--fcu udp://127.0.0.1:20001?listen=20000'
if [ -x "${CANNELLONI:-}" ]; then
  device_options='--duration 3'
  bridge vcan0
  begin cannelloni vcan0 press 20 $behind_udp --record $log/cannelloni.log
  finish
  begin stalls vcan0 press 20 $behind_udp
  await 'armed -> active' 0.1
  for _ in 1 2 3 4 5 6 7 8 9 10; do kill -STOP $bridge; sleep 0.02; kill -CONT $bridge; sleep 0.05; done
  finish
  kill $bridge
fi

# Classic CAN: the same hand at the rates of real devices, in frames of 8 bytes.
device_options='--device glove_hz_min=100 --device glove_hz_max=100 --device tracker_hz=60 --duration 3'
ip link add dev vcan1 type vcan && ip link set vcan1 mtu 16 up
candump -L vcan1 >$log/classic.log & dump=$!
begin classic vcan1 press 20 --record $log/classic_record.log
finish
kill $dump
replay classic_record.log classic_replay
replay classic.log classic_bus
if [ -x "${CANNELLONI:-}" ]; then
  bridge vcan1
  begin classic_cannelloni vcan1 press 20 $behind_udp
  finish
  kill $bridge
fi
mkdir -p "$out" && cp $log/* "$out/"
