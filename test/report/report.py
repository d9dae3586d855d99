# SPDX-License-Identifier: BSD-3-Clause
"""The report's page, doc/report.md, made of data/report/runs.csv and of what make bench measured (data/bench), and the sentences of
the README that hold a figure of these. Usage: report.py [FOLDER], that of the workflow: its rows become
data/report/runs.csv and force.csv first. `make report` calls it; test_report compares page and README with the tables."""
import csv
import os
import statistics
import sys
import textwrap

RUNS, FORCE, PAGE = "data/report/runs.csv", "data/report/force.csv", "doc/report.md"
KEYS = ("preset", "k_f", "rate_hz", "grasp", "device")
COLUMNS = KEYS + ("seeds", "held", "slip_mm", "way_mm", "tilt_deg", "depth_mm", "mean_n", "std_median_n", "std_n", "worst_std_n",
                  "max_n", "energy_up_j", "given_j")
PRESETS = ("paper", "stock", "default")
CHOICES = {"default": "default", "joints": "`coupling.finger_joints`", "pads": "`contact.patch_mm = 5`", "passivity": "passivity controller on",
           "observer": "`finger.observer`"}
# Grasp: what it is called on the page, its trace in data/bench, and the paper's loop rate in Hz (its Figures 6 to 8).
TESTS = {"box": ("box", "power_box", 250), "frame": ("frame", "bar_frame", 250), "bunny250": ("bunny, 250 polygons", "power_bunny250", 230),
         "bunny": ("bunny, 69,666 polygons", "power_bunny", None)}
GRASPS = {"box": "power grasp of a box", "pinch": "pinch", "tripod": "tripod", "regrasp": "regrasp", "frame": "frame by its bar",
          "hung": "frame hung on a finger"}
HELD_STIFFER = ("box", "pinch", "tripod", "regrasp", "frame")
STIFFNESSES = (200, 500, 1000, 2000, 5000, 10000)
VARIANTS = {"newton": "newton over core (default)", "libccd": "newton over libccd (`--narrow libccd`)", "dantzig": "dantzig (ODE) over core",
            "quickstep": "quickstep (ODE) over core", "stock": "preset `stock`: dantzig over libccd", "paper": "preset `paper`"}
COUNTED = ("power_box", "bar_frame", "power_bunny250")
WORDS = ("none", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten")


def read(path):
    with open(path, encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


# ---- from the workflow's rows to the table -------------------------------------------------------------------------
def worst(rows, column):
    """Of the seeds that held; of all where none did."""
    held = [r for r in rows if r["held"] == "1"] or rows
    return max(held, key=lambda r: float(r[column]))[column]


def summary(path):
    name = os.path.basename(path).removesuffix(".csv").split("-")
    rows = read(path)
    row = dict(zip(KEYS, name), seeds=len(rows), held=sum(r["held"] == "1" for r in rows))
    row.update({c: worst(rows, c) for c in COLUMNS if c in rows[0] and c not in row})
    kept = [r for r in rows if r["held"] == "1"] or rows
    row["mean_n"] = f"{statistics.mean(float(r['mean_n']) for r in kept):.3f}"
    row["std_median_n"] = f"{statistics.median(float(r['std_n']) for r in kept):.5f}"
    row["max_n"] = max(rows, key=lambda r: float(r["max_n"]))["max_n"]
    return row


def order(row):
    return (PRESETS + tuple(CHOICES)).index(row["preset"]), int(row["rate_hz"]), int(row["k_f"]), row["grasp"], row["device"]


def write(path, head, rows):
    os.makedirs(os.path.dirname(path), exist_ok=True)
    with open(path, "w", encoding="utf-8", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows([head] + rows)


def collect(folder):
    with open(os.path.join(folder, "names"), encoding="utf-8") as file:
        paths = [os.path.join(folder, "runs", name + ".csv") for name in file.read().split()]
    rows = sorted((summary(path) for path in paths), key=order)
    write(RUNS, COLUMNS, [[row[c] for c in COLUMNS] for row in rows])
    shown = [f"{preset}-200-1000-box-{device}" for device in ("best", "real") for preset in ("default", "paper")]
    series = [list(csv.reader(open(os.path.join(folder, "runs", name + ".force"), encoding="utf-8"))) for name in shown]
    write(FORCE, ["time_s"] + shown, [[points[0][0]] + [p[1] for p in points] for points in zip(*series)])


# ---- reading ------------------------------------------------------------------------------------------------------
class Figures:
    """All tables, asked by name."""

    def __init__(self):
        self.runs = {tuple(row[k] for k in KEYS): row for row in read(RUNS)}
        self.steps = {(r["scene"], r["what"]): r for r in read("data/bench/steps.csv")}
        self.times = {(r["scene"], r["variant"]): float(r["median_us"]) for r in read("data/bench/solver_times.csv")}
        self.tail = {r["scene"]: r for r in read("data/bench/tail.csv")}
        self.solvers = read("data/bench/solvers.csv")
        self.latency = {r["what"]: r for r in read("data/bench/latency.csv")}

    def run(self, preset, grasp, device, k_f=200, rate=1000):
        return self.runs[preset, str(k_f), str(rate), grasp, device]

    def step_us(self, preset, trace):
        return self.times[trace, "newton" if preset == "default" else preset]

    def of_variant(self, variant):
        return [r for r in self.solvers if r["variant"] == variant]


def most(rows, column):
    return max(float(r[column]) for r in rows)


# ---- the page -----------------------------------------------------------------------------------------------------
def table(head, rows):
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    return "\n".join(lines + ["| " + " | ".join(row) + " |" for row in rows]) + "\n"


def paragraph(text):
    return textwrap.fill(" ".join(text.split()), 118, break_long_words=False, break_on_hyphens=False) + "\n"


def kilohertz(micros):
    return f"{1e3 / micros:.0f} kHz"


def rate_rows(f):
    for name, trace, rate in TESTS.values():
        peers = [float(f.steps[trace, peer]["median_us"]) for peer in ("mujoco", "bullet")]
        yield ([name, f"{rate} Hz" if rate else "not tried"] + [kilohertz(f.step_us(preset, trace)) for preset in PRESETS]
               + [kilohertz(float(f.tail[trace]["p999_us"]))] + [kilohertz(us) for us in peers])


def small(text, digits):
    """To so many digits behind the point, or `<` the last of them."""
    value, least = float(text), 10.0 ** -digits
    return "0" if value == 0 else f"< {least:.{digits}f}" if value < 0.5 * least else f"{value:.{digits}f}"


def energy(joules):
    return "0" if float(joules) == 0 else f"{1e6 * float(joules):.2g}"


def held(row):
    return f"{row['held']} of {row['seeds']}"


def hold_row(f, grasp, preset):
    best, real = f.run(preset, grasp, "best"), f.run(preset, grasp, "real")
    return [preset, small(best["way_mm"], 4), small(real["slip_mm"], 2), small(best["tilt_deg"], 3), small(best["depth_mm"], 3),
            small(best["std_n"], 4), small(real["std_n"], 3), energy(best["energy_up_j"]), f"{held(best)}, {held(real)}"]


def hold_table(f, grasp):
    rows = [hold_row(f, grasp, preset) for preset in PRESETS]
    for peer, name in (("mujoco", "MuJoCo"), ("bullet", "Bullet")):
        rows.append([name, small(f.steps[TESTS[grasp][1], peer]["slip_mm"], 4)] + [""] * 7)
    return table(["", "slip, mm: perfect glove", "real glove", "tilt, deg", "penetration, mm", "noise of the force, N: perfect", "real",
                  "energy, uJ", "held: perfect, real"], rows)


def coupling_row(f, grasp, k_f, rate, choice="default"):
    best, real = (f.run(choice, grasp, device, k_f, rate) for device in ("best", "real"))
    moving = f.runs.get((choice, str(k_f), str(rate), grasp, "moving"))
    noise = f"{float(real['std_median_n']):.3f} to {float(real['std_n']):.3f}" if int(real["held"]) else "-"
    outcome = "held" if best["held"] == best["seeds"] else "lost"
    return [f"{k_f} N/m", small(best["std_n"], 4), outcome, noise,
            held(real), held(moving) if moving else "", f"{float(best['max_n']):.1f}, {float(real['max_n']):.1f}"]


COUPLING_HEAD = ["k_f", "noise, perfect glove, N", "object", "noise, real glove, N: median to worst seed", "object", "object, user moves",
                 "largest force at any time, N: perfect, real"]


def coupling_table(f, grasp, rate):
    return table(COUPLING_HEAD, [coupling_row(f, grasp, k_f, rate) for k_f in STIFFNESSES])


def others_table(f, grasps, choice="default"):
    rows = []
    for grasp in grasps:
        for k_f in STIFFNESSES:
            row = coupling_row(f, grasp, k_f, 1000, choice)
            rows.append([GRASPS[grasp] if k_f == 200 else ""] + row[:6])
    return table(["grasp"] + COUPLING_HEAD[:6], rows)


def choice_rows(f):
    for k_f in (200, 2000):
        for choice, name in CHOICES.items():
            rows = {d: [f.run(choice, g, d, k_f) for g in GRASPS if g != "hung"] for d in ("best", "real")}
            sums = {d: [sum(int(r[c]) for r in rows[d]) for c in ("held", "seeds")] for d in rows}
            given = [float(f.run(choice, g, "real", k_f)["given_j"]) for g in ("box", "pinch")]
            yield [f"{k_f} N/m", name, small(most(rows["best"], "way_mm"), 4), small(most(rows["best"], "worst_std_n"), 4),
                   "{} of {}".format(*sums["best"]), small(most(rows["real"], "slip_mm"), 2), small(most(rows["real"], "worst_std_n"), 3),
                   "{} of {}".format(*sums["real"]), f"{given[0]:.2f}, {given[1]:.2f}"]


def grasp_rows(f):
    for grasp, name in GRASPS.items():
        best, real = f.run("default", grasp, "best"), f.run("default", grasp, "real")
        yield [name, small(best["way_mm"], 4), small(best["worst_std_n"], 4), small(real["slip_mm"], 2), small(real["worst_std_n"], 3), held(real)]


def percent(part, whole):
    share = 100 * part / whole
    return f"{share:.1f}" if share >= 1 else f"{share:.1g}"


def solver_cells(f, variant):
    mine = f.of_variant(variant)
    loaded, outside = (sum(int(r[c]) for r in mine) for c in ("loaded", "outside_cone"))
    cone = "fixed limits, no cone" if not loaded else "none" if not outside else (
        f"{percent(outside, loaded)} %, by up to {100 * (most(mine, 'worst') - 1):.0f} %")
    if variant == "newton":
        cone = f"none of {1000 * (loaded // 1000):,}"
    counts = ", ".join(f"{int(r['instructions']) / 1000:.0f}" for trace in COUNTED for r in mine if r["trace"] == trace)
    depth = most(mine, "depth_mm")
    return [VARIANTS[variant], f"{most(mine, 'slip_mm'):.2f} mm, {most(mine, 'tilt_deg'):.2f} deg",
            f"{depth:.1f} mm" if depth > 1 else f"{depth:.3f} mm", cone, counts]


SOLVERS_HEAD = ["worst of nine grasps", "slip, tilt", "deepest", "contacts outside the cone", "1000 instructions: box, bar, bunny"]


def in_short(f):
    times = lambda preset, of: [1e6 / f.step_us(preset, trace) / rate for _, trace, rate in TESTS.values() if rate] if of == "paper" else [
        float(f.steps[trace, of]["median_us"]) / float(f.steps[trace, "gloved whole"]["median_us"]) for _, trace, _ in TESTS.values()]
    span = lambda values: " to ".join(f"{v:.2g}" if v < 100 else f"{v:.0f}" for v in (min(values), max(values)))
    real = [f.run("default", grasp, "real") for grasp in TESTS]
    quiet = [k for k in STIFFNESSES if all(float(r["std_n"]) < 0.1 and r["held"] == r["seeds"] for r in (f.run("default", g, "real", k) for g in HELD_STIFFER))]
    perfect = [k for k in STIFFNESSES if all(float(r["std_n"]) < 0.01 and r["held"] == r["seeds"] for r in (f.run("default", g, "best", k) for g in HELD_STIFFER))]
    seen = [k for k in STIFFNESSES if all(float(r["std_n"]) < 0.1 and r["held"] == r["seeds"] for r in (f.run("observer", g, "real", k) for g in HELD_STIFFER))]
    lines = [f"On one core of today, the preset `paper` does {span(times('paper', 'paper'))} times the steps of the paper's loop, the default "
             f"{span(times('default', 'paper'))} times, in {span(times('', 'mujoco'))} times less time than MuJoCo and {span(times('', 'bullet'))} times less than Bullet.",
             f"With the default and the real glove the things of the paper's tests are held on {sum(int(r['held']) for r in real)} of {sum(int(r['seeds']) for r in real)} "
             f"runs, slip by at most {most(real, 'slip_mm'):.2f} mm in 8 s, and the thumb feels at most {most(real, 'std_n'):.3f} N of noise.",
             f"All five grasps are held, with less than 0.1 N of noise at the thumb, up to {max(quiet, default=0)} N/m with the real glove ({max(seen, default=0)} N/m with the observer of the user's fingers), "
             f"and with less than 0.01 N up to {max(perfect, default=0)} N/m with the perfect one, among the stiffnesses tried."]
    return "".join(textwrap.fill("- " + line, 118, subsequent_indent="  ", break_long_words=False, break_on_hyphens=False) + "\n" for line in lines)


def page(f):
    seeds = f.run("default", "box", "real")["seeds"]
    parts = ["<!-- Made by `make report`, not by hand. -->\n", "# Report\n", paragraph(f"""
        The three tests of the paper that gloved follows (Zaeh, Egermeier, Petzold and Schmid, 2005), done anew: the same
        things grasped, lifted and held for 9 s by the simulated user, with the preset `paper` (the paper's parameters on the packages
        that it names), `stock` (ODE and libccd with gloved's parameters) and the default; with a perfect glove (12 bits, 1 kHz) and
        with one as recordings show them (`device=real`: 8 bits, 90 to 150 Hz, noise, jumps, late and lost frames) on {seeds} seeds.
        MuJoCo and Bullet play the same motions of the same fingers, with the same springs. `make report` runs all of it in virtual
        time, on all cores, into `data/report` and this page; times are those that `make bench` left in `data/bench` last, to be
        measured on a quiet machine."""),
             "## In short\n", in_short(f),
             "## How fast\n", paragraph("""
        Steps a second: one over the median time of a step while the object is held, collision detection and dynamics whole, on one
        core of the machine of `make bench`. The paper's loop ran on four MIPS R10000 of 250 MHz, and its box has 12 polygons, its
        frame 38, its bunny 250, as here. The last bunny is the mesh with all its polygons in 67 convex pieces. The column 99.9 % says
        what 99.9 % of the default's steps reach."""),
             table(["", "paper", "preset paper", "stock", "default", "99.9 %", "MuJoCo", "Bullet"], rate_rows(f)),
             "![Steps a second, with the paper's line](../data/pictures/report-rate.svg)\n",
             "## How well it holds\n", paragraph("""
        Slip: how far the object moves in the palm at most (with the real glove: the point that the hand holds, from its mean place in
        the first second to that in the last, worst seed that held). Penetration: the deepest contact of a finger limb or the palm.
        Noise: standard deviation of the thumb's commanded tension over the 9 s, worst seed. Energy: the largest rise of mechanical
        energy (springs of the coupling, limbs, objects in gravity) above what it was before, with the perfect glove, whose user holds
        still, so that every rise comes from nowhere. The paper gives none of these figures; of MuJoCo and Bullet slip was measured.""")]
    for grasp, (name, _, _) in TESTS.items():
        parts += [f"### {name[0].upper() + name[1:]}\n", hold_table(f, grasp)]
    parts += ["![The thumb's force while the box is grasped, lifted and held](../data/pictures/report-force.svg)\n",
              paragraph(f"""
        The preset `paper` holds what it holds by penetration ({most([f.run('paper', g, 'best') for g in TESTS], 'depth_mm'):.1f} mm at most, where the
        default has {most([f.run('default', g, 'best') for g in TESTS], 'depth_mm'):.3f} mm) and by friction that knows no cone: its mu of 200 is a force in newtons."""),
              "## The grasps that are recorded, default\n",
              table(["grasp", "slip, mm: perfect glove", "noise of any finger, N", "slip, mm: real glove", "noise of any finger, N", "held"], grasp_rows(f)),
              "## Stiffer couplings\n", paragraph("""
        The spring between the measured and the simulated finger (`coupling.limb.k_f`) says how hard a surface can feel: the paper has
        200 N/m, a hard surface wants 800 to 1000 (Choi 2004). Everything else is the default; the object is lost where it is below 50 mm of
        height at any time, or its grip has slid by more than 5 mm. The user who moves sways each finger by 30 mrad at 2 Hz and the wrist by 2 mm, with 1 mrad of tremor.
        A person notices some 0.05 N at rest. [How stiff](zwidth.md) maps the same loop over damping, delay, rate and finger. Power grasp of the box, 1 kHz:"""),
              coupling_table(f, "box", 1000), "The same at 5 kHz:\n", coupling_table(f, "box", 5000),
              "![Noise of the thumb's force over the coupling's stiffness](../data/pictures/report-couplings.svg)\n",
              "The other grasps, 1 kHz:\n", others_table(f, HELD_STIFFER[1:]),
              paragraph("""
        All five with the observer of the user's fingers (`finger = { observer = true; };`), 1 kHz. The simulated fingers are as firm as
        it takes them to be, which flatters it; what others do to it: [tuning](tuning.md)."""),
              others_table(f, HELD_STIFFER, "observer"),
              "## By choice\n", paragraph("""
        What can be switched on, beside the default, the worst of the five grasps above (seeds that held): joints between the limbs
        of a finger, soft pads, the passivity controller, and the observer of the user's fingers ([tuning](tuning.md) says when the last
        two help and when they harm). Energy: the most that a
        tendon gave out by the observer's count, in the power grasp and in the pinch, worst seed."""),
              table(["k_f", "", "slip, mm: perfect glove", "noise of any finger, N", "held", "slip, mm: real glove", "noise of any finger, N", "held",
                     "given out, J: box, pinch"], choice_rows(f)),
              "## Solvers\n", paragraph("""
        On the recorded grasps (`make solvers`, `data/bench/solvers.csv`), perfect glove; one of the nine is with the real one."""),
              table(SOLVERS_HEAD, [solver_cells(f, v) for v in VARIANTS])]
    return "\n".join(parts)


# ---- the README ---------------------------------------------------------------------------------------------------
def count(value):
    return WORDS[round(value)]


def readme(f):
    """What the README must say, word by word but for the ends of lines."""
    best, real = ({g: f.run("default", g, device) for g in GRASPS} for device in ("best", "real"))
    five = [g for g in GRASPS if g != "hung"]
    all_held = all(real[g]["held"] == real[g]["seeds"] for g in GRASPS)
    slips = [(most([best[g] for g in of], "way_mm"), most([real[g] for g in of], "slip_mm")) for of in (five, ["hung"])]
    ends = "all held" if all_held else "not all held"
    thousand = {r["trace"]: 1000 * round(int(r["instructions"]) / 1000) for r in f.of_variant("newton") if r["instructions"]}
    pair = lambda what, column, digits: [f"{float(f.steps[t, what][column]):{digits}}" for t in ("power_box", "power_bunny250")]
    micros, mujoco, bullet = pair("gloved whole", "median_us", ".0f"), pair("mujoco", "ratio", ".2g"), pair("bullet", "ratio", ".2g")
    live = float(f.latency["step (median)"]["median_us"]) / float(f.steps["power_box", "gloved whole"]["median_us"])
    quick = f.of_variant("quickstep")
    costs = [int(r["instructions"]) / int(n["instructions"]) for v in ("dantzig", "quickstep") for r, n in zip(f.of_variant(v), f.of_variant("newton")) if r["instructions"]]
    share = percent(*(sum(int(r[c]) for r in quick) for c in ("outside_cone", "loaded")))
    yield f"| perfect glove | glove as recordings show them (8 bits, 90 Hz, noise, losses), {real['box']['seeds']} seeds |"
    yield f"| power, pinch, tripod grasp of a box, regrasp, a bar | {slips[0][0]:.3f} mm | {slips[0][1]:.2f} mm, {ends} |"
    yield f"| a frame hung on a finger, where its bar lies on it | {slips[1][0]:.2f} mm | {slips[1][1]:.2f} mm, {ends} |"
    yield f"A step takes {thousand['power_box']:,} instructions with the box in the hand and {thousand['power_bunny250']:,} with a bunny of 20 convex pieces"
    yield f"{micros[0]} and {micros[1]} us on one core of an AMD EPYC"
    yield f"MuJoCo takes {mujoco[0]} and {mujoco[1]} times as long, Bullet {bullet[0]} and {bullet[1]}"
    yield f"a live loop, which wakes to cold caches, takes {count(live)} times that (`make latency`)"
    yield f"quickstep leaves {share} % of the contacts outside it"
    yield f"takes {count(min(costs))} to {count(max(costs))} times the instructions"
    for variant in VARIANTS:
        yield "| " + " | ".join(solver_cells(f, variant)) + " |"


def missing(f):
    with open("README.md", encoding="utf-8") as file:
        text = " ".join(file.read().split())
    return [line for line in readme(f) if line not in text]


def main():
    if len(sys.argv) > 1:
        collect(sys.argv[1])
    f = Figures()
    with open(PAGE, "w", encoding="utf-8") as file:
        file.write(page(f))
    print(f"report: {PAGE}, from {len(f.runs)} configurations")
    for line in missing(f):
        print(f"report: the README should say now: {line}")


if __name__ == "__main__":
    main()
