# SPDX-License-Identifier: BSD-3-Clause
"""Judges what the guest of test/rt/run said. Its time is counted in instructions, so that late is late on any machine.
Usage: judge.py CONSOLE"""
import json
import re
import sys

with open(sys.argv[1]) as console:
    text = console.read()
fails = passes = 0


def verdict(name, good, why=""):
    global fails, passes
    fails += not good
    passes += bool(good)
    print(f"ok {name}" if good else f"  {why}\nFAIL {name}")


def lines(start):
    return [line[len(start):] for line in text.splitlines() if line.startswith(start)]


def read(start):
    try:
        return json.loads("\n".join(lines(start)))
    except ValueError:
        return {}


def judge_grasp(name):
    s, device = read(f"{name} json: "), read(f"{name} report: ")
    said = "\n".join(lines(f"{name} gloved: "))
    verdict(f"{name}_both_end_well", f"{name} gloved exit 0" in text and f"{name} fcusim exit 0" in text, said)
    if not s or not device:
        verdict(f"{name}_left_a_summary", False, said)
        return s
    threads = sorted(lines(f"{name} thread "))
    verdict(f"{name}_one_thread_with_priority_and_list",
            len(threads) == 2 and re.search(r"policy 0 .*Seccomp:\s+0", threads[0]) and re.search(r"policy 1 priority 80 Seccomp:\s+2", threads[1]), threads)
    box = next(o for o in s["objects"] if o["name"] == "box")
    verdict(f"{name}_lifts_the_box", box["position"][2] > 0.15 and max(s["force_max_n"]) > 1 and s["state"] == "active", said)
    verdict(f"{name}_keeps_its_deadlines", s["steps"] + s["overruns"] == 8000 and s["missed_deadlines"] <= 4, said)
    verdict(f"{name}_takes_no_memory_in_the_loop", s["rt_heap_calls"] == 0 and s["rt_page_faults"] == {"major": 0, "minor": 0}, said)
    verdict(f"{name}_loses_nothing", s["frames"]["lost"] == 0 and s["frames"]["bad"] == 0 and not device["refused_frames"] and
            not device["over_max"] and not device["over_slew"], (s["frames"], device))
    step, wake = s["step_us"], s["wake_us"]
    print(f"figure {name}: step p50 {step['p50']:.0f} max {step['max']:.0f} us, wake-up p50 {wake['p50']:.0f} max {wake['max']:.0f} us (of 2 ns an instruction)")
    return s


verdict("the_kernel_is_preempt_rt", re.search(r"^kernel .*PREEMPT_RT", text, re.M), text[-2000:])
judge_grasp("clock")
followed = judge_grasp("device")
if followed:
    verdict("device_steps_begin_with_frames", followed["sync"]["on_frame"] > 7900, followed["sync"])
    verdict("device_replays_to_the_same_bits", read("replay json: ").get("state_hash") == followed["state_hash"], followed["state_hash"])
verdict("doctor_knows_the_kernel_and_the_emulation", re.search(r"doctor: PASS +kernel +PREEMPT_RT", text) and
        re.search(r"doctor: FAIL +virtual machine", text), lines("doctor: "))
verdict("the_guest_ended_by_itself", "guest is done" in text, text[-2000:])
print(f"{passes} passed, {fails} failed")
sys.exit(fails > 0)
