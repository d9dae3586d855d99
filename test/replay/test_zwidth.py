# SPDX-License-Identifier: BSD-3-Clause
"""What `make zwidth` calls stable, against what is known without it: the bound of a sampled virtual wall (Colgate and Schenkel,
Passivity of a class of sampled-data systems, 1997; with delay: Diolaiti and others, 2006): a wall of stiffness K and no damping
is passive where the device's own damping b is at least K (T / 2 + tau). And what makes a loop worse never widens the region."""
import csv
import io
import os
import subprocess
import tempfile

POINT = os.environ.get("B", "build/gcc-O2") + "/test/zwidth_point"


def outcomes(k, *settings):
    run = subprocess.run([POINT, "k=" + ",".join(f"{one:.0f}" for one in k), *settings], capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    return {float(row["k_n_m"]): row for row in csv.DictReader(io.StringIO(run.stdout))}


# One joint, the knuckle: the others do not give way. No sample filter, no damping in the coupling. The finger on the wall then is a
# spring of ARM_M squared times k about the knuckle: the wall pushes 70 mm away from it, the tendon pulls at 65 mm.
STIFFNESS, INERTIA, RATIO = 4.0, 3e-4, 0.1
ONE_JOINT = (f"stiffness_0={STIFFNESS}", f"inertia_0={INERTIA}", f"damping_ratio={RATIO}", "stiffness_1=100", "stiffness_2=100",
             "inertia_1=1e-3", "inertia_2=1e-3", "filter_hz=0", "d=0")
DAMPING = 2.0 * RATIO * (STIFFNESS * INERTIA) ** 0.5
ARMS_M2 = 0.065 * 0.07
CYCLE_S = 1e-4  # until the device has taken a command


def bound(rate_hz, delay_ms):
    return DAMPING / (0.5 / rate_hz + 1e-3 * delay_ms + CYCLE_S) / ARMS_M2


def test_passive_walls_do_not_oscillate_and_what_is_far_beyond_does():
    for rate_hz, delay_ms in ((1000, 1), (1000, 2), (1000, 4), (500, 2)):
        k = bound(rate_hz, delay_ms)
        found = outcomes([0.5 * k, k, 8 * k], f"rate={rate_hz}", f"delay_ms={delay_ms}", *ONE_JOINT)
        said = [row["outcome"] for row in found.values()]
        assert "oscillates" not in said[:2] and said[2] == "oscillates", (rate_hz, delay_ms, k, said)
        fed = [float(row["power_w"]) for row in found.values()]
        assert max(fed[:2]) < 1e-4 and fed[2] > 1e-2, fed  # what feeds the finger is the loop


# ---- the exact loop -------------------------------------------------------------------------------------------------
# One joint I d'' + c d' + k d = -T with the loop around it: its angle sampled at the rate, held up by half of the wire's delay on
# either way, taken by the loop's next step, told one step ahead along its last change (the engine's own lead), a torque T in
# proportion to it, held until the next. Written here for itself, in steps of the device's 0.1 ms.

def grows(torque_per_rad, rate_hz, delay_ms):
    every, wire = round(1e4 / rate_hz), round(5 * delay_ms)
    angle, speed, torque, newest, before = 1e-3, 0.0, 0.0, 1e-3, 1e-3
    to_loop, to_device, peak = [], [], [0.0, 0.0]
    steps = 30000
    for i in range(steps):
        if i % every == 0:
            to_loop.append((i + wire, angle))
            while to_loop and to_loop[0][0] <= i:
                newest = to_loop.pop(0)[1]
            to_device.append((i + wire + 1, torque_per_rad * (2 * newest - before)))
            before = newest
        while to_device and to_device[0][0] <= i:
            torque = to_device.pop(0)[1]
        speed = (INERTIA * speed + CYCLE_S * (-torque - STIFFNESS * angle)) / (INERTIA + CYCLE_S * DAMPING + CYCLE_S ** 2 * STIFFNESS)
        angle += CYCLE_S * speed
        if abs(angle) > 1.0:
            return True
        if i >= steps // 3:
            peak[i >= 2 * steps // 3] = max(peak[i >= 2 * steps // 3], abs(angle))
    return peak[1] > peak[0]


def onset(rate_hz, delay_ms):
    """Torque a radian at which the exact loop begins to oscillate."""
    low, high = 0.1, 100.0
    while high / low > 1.02:
        middle = (low * high) ** 0.5
        low, high = (low, middle) if grows(middle, rate_hz, delay_ms) else (middle, high)
    return low


def torque_per_stiffness(*settings):
    """What a coupling of 1 N/m is at the knuckle, N m/rad, from how far two of them push the finger back: F = A k / (k0 + k)."""
    k = (300.0, 900.0)
    force = [float(outcomes([one], *settings)[one]["force_n"]) for one in k]
    ratio = force[1] / force[0] * k[0] / k[1]
    return STIFFNESS / ((k[0] - ratio * k[1]) / (ratio - 1.0))


def test_oscillation_begins_where_the_exact_loop_says():
    """Without friction at the fingertip, which would damp and stiffen: none at 0.7 of that stiffness, always at twice of it."""
    with tempfile.NamedTemporaryFile("w", suffix=".conf") as smooth:
        smooth.write("version = 1;\ncontact = { mu_hand = 0.0; };\n")
        smooth.flush()
        rig = (*ONE_JOINT, "inertia_1=1e-6", "inertia_2=1e-6", f"config={smooth.name}")
        per_k = torque_per_stiffness("rate=1000", "delay_ms=1", *rig)
        for rate_hz, delay_ms in ((1000, 1), (1000, 2), (1000, 4), (500, 2)):
            k = onset(rate_hz, delay_ms) / per_k
            found = outcomes([0.7 * k, 2.0 * k], f"rate={rate_hz}", f"delay_ms={delay_ms}", *rig)
            said = [row["outcome"] for row in found.values()]
            print(f"figure {rate_hz} Hz, {delay_ms} ms: the exact loop oscillates from {k:.0f} N/m on; at 0.7 and 2 of it: {', '.join(said)}")
            assert said[0] in ("stable", "noisy") and said[1] == "oscillates", (rate_hz, delay_ms, k, said)


K = (500, 1000, 2000, 4000, 8000, 16000, 32000, 64000)


def stiffest(*settings):
    """Up to which the loop does not oscillate."""
    best = 0.0
    for k, row in outcomes(K, *settings).items():
        if row["outcome"] not in ("stable", "noisy"):
            break
        best = k
    return best


def never_wider(*series):
    tops = [stiffest(*settings) for settings in series]
    assert tops == sorted(tops, reverse=True) and tops[0] > tops[-1], tops


def test_delay_never_widens_the_region():
    never_wider(*([f"delay_ms={ms}", "finger=relaxed"] for ms in (0, 5, 20)))
    never_wider(*([f"delay_ms={ms}", "filter_hz=0", "d=0"] for ms in (0, 2, 5)))


def test_a_slower_loop_never_widens_the_region():
    never_wider(*([f"rate={hz}", *ONE_JOINT, "delay_ms=1"] for hz in (1000, 500, 250)))


def test_a_coarser_quantum_is_never_quieter():
    noise = [float(outcomes([4000], f"quantum={rad}", "finger=relaxed")[4000]["std_n"]) for rad in (0.001, 0.005, 0.0175)]
    assert noise == sorted(noise) and noise[-1] > noise[0], noise
