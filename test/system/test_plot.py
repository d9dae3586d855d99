# SPDX-License-Identifier: BSD-3-Clause
# gloved-plot on a log of its own: tables against the messages of the log, energy against the spring's force, pictures
# that show something, MCAP read back by its own library, bad input.
import csv
import glob
import json
import os
import subprocess
import sys
import tempfile

B = os.environ["B"]
PYTHON = os.path.abspath("build/venv-plot/bin/python")
USER = """posture flat thumb_abduction 40 index_mpj 0
posture press like flat index_mpj 60
at 0.0 posture flat wrist -0.3 0 0.06 0 0 0 dead_man off
at 0.1 dead_man on
at 0.4 posture press
at 1.6 posture press
at 2.0 posture flat
at 2.6 posture flat
end 30
"""
sys.path.insert(0, "tools")
from gloved_names import FINGERS  # noqa: E402
failed = False


def verdict(name, why):
    global failed
    print(f"ok {name}" if not why else f"  {why}\nFAIL {name}", flush=True)
    failed |= bool(why)


def plot(*arguments):
    return subprocess.run([PYTHON, "tools/gloved_plot.py", *arguments], capture_output=True, text=True)


def table(path):
    with open(path, newline="") as file:
        return [{key: value if key == "safety" else float(value) for key, value in row.items()} for row in csv.DictReader(file)]


def check_tables(folder, states, stats):
    rows = table(folder + "/state.csv")
    same = lambda a, b: abs(a - b) <= 1e-6 * abs(b)  # rounded to seven digits
    wrong = [r["time_s"] for r, s in zip(rows, states) if not same(r["time_s"], s.time_s)
             or not all(same(r[f"commanded_{f}_n"], n) for f, n in zip(FINGERS, s.force_commanded_n))
             or not all(same(r[f"given_{f}_j"], -n) for f, n in zip(FINGERS, s.energy_j))
             or not same(r["index_mpj_rad"], s.angle_rad[4]) or not same(r["box_z_m"], s.object[1].position_m[2])]
    verdict("the_table_is_the_log", f"at {wrong[:3]}" if wrong or len(rows) != len(states) else "")
    deepest = max(r["depth_index_m"] for r in rows)
    wanted = max((c.depth_m for s in states for c in s.contact if 3 <= c.limb < 6), default=0)
    verdict("penetration_is_the_contacts", "" if same(deepest, wanted) and wanted > 0 else f"{deepest} {wanted}")
    # At rest the coupling's force is k x, so its energy is f^2 / 2 k and t^2 / 2 k_t.
    still = next(i for i, s in enumerate(states) if s.time_s >= 1.5)
    k = stats[-1]
    limbs = [states[still].limb[i] for i in (3, 4, 5)]
    energy = sum(sum(x * x for x in limb.force_n) / (2 * k.limb_k_f) + sum(x * x for x in limb.torque_nm) / (2 * k.limb_k_t) for limb in limbs)
    verdict("energy_is_the_springs", "" if abs(rows[still]["energy_index_j"] / energy - 1) < 0.02 and energy > 1e-4 else f"{rows[still]['energy_index_j']} {energy}")
    steps = table(folder + "/steps.csv")
    with open(folder + "/state.csv") as file:
        longest = max(len(cell) for line in file.readlines()[1:] for cell in line.strip().split(","))
    verdict("numbers_are_rounded", "" if longest <= 13 else f"{longest} characters")
    verdict("every_step_has_a_row", "" if len(steps) == states[-1].step else f"{len(steps)} of {states[-1].step}")


def check_pictures(folder, names):
    check = "import sys\nfrom PIL import Image\nfor p in sys.argv[1:]:\n i=Image.open(p).convert('RGB')\n" \
        " print(i.width,i.height,sum(n for n,(r,g,b) in i.getcolors(1<<24) if max(r,g,b)-min(r,g,b)>60))\n"
    run = subprocess.run([PYTHON, "-c", check, *(f"{folder}/{n}.png" for n in names)], capture_output=True, text=True)
    sizes = [tuple(map(int, line.split())) for line in run.stdout.splitlines()]
    verdict("pictures_show_curves", "" if len(sizes) == len(names) and all(w > 1000 and h > 400 and c > 500 for w, h, c in sizes) else f"{sizes} {run.stderr}")
    with open(folder + "/index.html", encoding="utf-8") as file:
        page = file.read()
    endings = [f"{n}.{e}" for n in names for e in ("pdf", "svg") if os.path.getsize(f"{folder}/{n}.{e}") < 3000]
    verdict("pictures_are_pdf_and_svg_too", "" if not endings else f"{endings}")
    verdict("the_page_has_them_all", "" if all(f"src='{n}.png'" in page for n in names) and "armed -&gt; active" in page else page[:300])


def check_mcap(folder, states):
    read = "import sys,json\nfrom mcap.reader import make_reader\n" \
        "m=[(c.topic,json.loads(x.data),x.log_time) for _,c,x in make_reader(open(sys.argv[1],'rb')).iter_messages()]\n" \
        "s=[d for t,d,_ in m if t=='/gloved_state']\nprint(json.dumps([len(s), s[-1]['limb'][3]['position_m'], sorted({t for t,_,_ in m})]))"
    run = subprocess.run([PYTHON, "-c", read, folder + "/run.mcap"], capture_output=True, text=True)
    wanted = [len(states), list(states[-1].limb[3].position_m), ["/gloved_event", "/gloved_state", "/gloved_stats"]]
    verdict("mcap_reads_back", "" if run.returncode == 0 and json.loads(run.stdout) == wanted else f"{run.stdout} {run.stderr}")


def check_bad_input(folder):
    with open(folder + "/empty.lcm", "wb"):
        pass
    with open(folder + "/text.lcm", "w") as file:
        file.write("this is no log\n" * 100)
    runs = [plot(folder + "/missing.lcm"), plot(folder + "/empty.lcm"), plot(folder + "/text.lcm"), plot(), plot("a", "--compare", "b", "c")]
    bad = [r.stderr for r in runs if r.returncode == 0 or "Traceback" in r.stderr or not r.stderr.strip()]
    verdict("bad_input_is_answered", bad[0] if bad else "")


def check_as_printed(folder):
    """gloved-plot and log-to-trace as the pages print them, from a folder of somebody else's; relative names are that folder's."""
    tools = os.path.abspath("tools")
    run = subprocess.run([tools + "/gloved-plot", "a.lcm", "--out", "here"], cwd=folder, capture_output=True, text=True)
    page = os.path.join(folder, "here", "index.html")
    text = open(page).read() if os.path.exists(page) else ""
    verdict("gloved_plot_runs_from_anywhere", "" if run.returncode == 0 and "made by" in text and "box.scene (" in text else f"{run}")
    run = subprocess.run([sys.executable, tools + "/log_to_trace.py", "a.lcm", "a.log"], cwd=folder, capture_output=True, text=True)
    good = run.returncode == 0 and os.path.exists(folder + "/a.log") and os.path.exists(folder + "/a.log.about")
    verdict("log_to_trace_runs_from_anywhere", "" if good else f"{run}")
    if not os.path.exists("build/venv-look/.done"):
        print("skip log_to_trace_as_printed: its Python environment is not made yet, and a test fetches nothing; make look makes it")
        return
    run = subprocess.run([tools + "/log-to-trace", "a.lcm", "b.log"], cwd=folder, capture_output=True, text=True)
    verdict("log_to_trace_as_printed", "" if run.returncode == 0 and open(folder + "/a.log").read() == open(folder + "/b.log").read() else f"{run}")


def main():
    if not os.path.exists(PYTHON):
        print("skip test_plot: build/venv-plot is missing (make test builds it)")
        return 0
    with tempfile.TemporaryDirectory() as folder:
        with open(folder + "/press.user", "w") as file:
            file.write(USER)
        for name, device in (("a", "best"), ("b", "real")):
            subprocess.run([B + "/gloved", "--fcu", f"sim:{folder}/press.user?device={device}&speed=0", "--lcm", "none", "--duration", "2.5",
                            "--log", f"{folder}/{name}.lcm"], stdout=subprocess.DEVNULL, check=True)
        run = plot(f"{folder}/a.lcm")
        verdict("one_command_makes_all", "" if run.returncode == 0 and run.stdout.strip().endswith("a-plots/index.html") else run.stderr)
        check_as_printed(folder)
        subprocess.run(["lcm-gen", "-p", "--ppath", folder, *sorted(glob.glob("data/lcm/*.lcm"))], check=True, stdout=subprocess.DEVNULL)
        sys.path.insert(0, folder)
        import gloved
        import lcm
        log = list(lcm.EventLog(folder + "/a.lcm"))
        states = [gloved.state_t.decode(e.data) for e in log if e.channel == "GLOVED_STATE"]
        stats = [gloved.stats_t.decode(e.data) for e in log if e.channel == "GLOVED_STATS"]
        kinds = ["force", "penetration", "force-penetration", "angles", "objects", "timing", "energy"]
        names = [f"a-{kind}" for kind in kinds]
        check_tables(folder + "/a-plots", states, stats)
        check_pictures(folder + "/a-plots", names)
        check_mcap(folder + "/a-plots", states)
        run = plot("--compare", folder + "/a.lcm", folder + "/b.lcm", "--out", folder + "/two")
        verdict("two_runs_are_compared", "" if run.returncode == 0 else run.stderr)
        check_pictures(folder + "/two", [f"a-b-{kind}" for kind in kinds])
        with open(folder + "/two/index.html", encoding="utf-8") as file:
            page = file.read()
        verdict("two_runs_have_a_table_of_differences", "" if "<th>difference" in page and "largest force, index" in page else page[:300])
        check_bad_input(folder)
    return 1 if failed else 0


sys.exit(main())
