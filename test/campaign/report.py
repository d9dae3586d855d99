# SPDX-License-Identifier: BSD-3-Clause
"""The campaign's page: what the workers' rows say about the promises that every step keeps, about who holds what, and about slip.
Usage: report.py CALL OUT.html ROWS.csv...; `make campaign` calls it. Plots lie beside the page. The promises are judged: exit
code 1 where one is broken, with the seeds, and the page is called broken.html."""
import csv
import html
import os
import sys

import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402 (after the choice of the canvas)

SOLVERS = ("newton", "dantzig", "quickstep", "mujoco")
# A rule of contact, its column, and the most that newton's own answers may have.
RULES = (("friction beyond mu (1 + 1e-3) times the normal force of the step, N", "outside_n", 1e-4),
         ("slip below the bound of friction, m/s", "creep_m_s", 1e-5),
         ("friction against slip, degrees", "astray_deg", 1.0),
         ("a contact pulls, N", "pull_n", 1e-6),
         ("Signorini: closes faster than its spring lets it, or pushes and parts, m/s", "closing_m_s", 1e-6),
         ("momentum from nowhere, N s", "momentum_n_s", 1e-10))
COLORS = {"newton": "C0", "dantzig": "C1", "quickstep": "C2", "mujoco": "C3"}


def read_rows(paths):
    rows = [row for path in paths for row in csv.DictReader(open(path))]
    known = [r for r in rows if r["outcome"] != "absent"]
    return known, len(rows) - len(known)


def number(row, column):
    return float(row[column])


def of_solver(rows, solver):
    return [r for r in rows if r["solver"] == solver]


def by_seed(rows):
    found = {}
    for r in rows:
        found.setdefault((r["family"], int(r["seed"])), {})[r["solver"]] = r
    return found


# ---- judging ------------------------------------------------------------------------------------------------------
def judge(rows):
    """Broken promises in words."""
    broken = []
    for what, column, most in RULES:
        for r in of_solver(rows, "newton"):
            if not number(r, column) <= most:
                broken.append(f"{r['family']} {r['seed']}: {what}: {r[column]}, allowed {most:g}")
    for r in rows:
        if int(r["bad_forces"]):
            broken.append(f"{r['family']} {r['seed']} {r['solver']}: {r['bad_forces']} steps with a force beyond the limiter's promises")
        if int(r["resets"]):
            broken.append(f"{r['family']} {r['seed']} {r['solver']}: a body ran away")
    return broken


def disputes(rows):
    """Grasps that not all solvers end alike."""
    return [(key, of) for key, of in sorted(by_seed(rows).items()) if len({r["outcome"] for r in of.values()}) > 1]


# ---- tables -------------------------------------------------------------------------------------------------------
def table(head, body):
    cells = lambda tag, values: "<tr>" + "".join(f"<{tag}>{html.escape(str(v))}</{tag}>" for v in values) + "</tr>"
    return "<table>" + cells("th", head) + "".join(cells("td", row) for row in body) + "</table>"


def worst(rows, column):
    return max((number(r, column) for r in rows), default=0.0)


def total(rows, column):
    return sum(int(r[column]) for r in rows)


def rules_table(rows, solvers):
    ours = [s for s in solvers if s != "mujoco"]
    body = [[what, f"{most:g}"] + [f"{worst(of_solver(rows, s), column):.2g}" for s in ours] for what, column, most in RULES]
    share = lambda s: 100.0 * total(of_solver(rows, s), "outside") / max(1, total(of_solver(rows, s), "loaded"))
    body.append(["contacts outside the cone, %", "0"] + [f"{share(s):.2g}" for s in ours])
    body.append(["by what factor, at most", ""] + [f"{worst(of_solver(rows, s), 'ratio'):.3g}" for s in ours])
    for what, column in (("steps with contacts", "steps"), ("left to another solver", "others"), ("softer or older friction than asked", "weaker")):
        body.append([what, ""] + [total(of_solver(rows, s), column) for s in ours])
    body.append(["steps with a force beyond the limiter's promises", "0"] + [total(of_solver(rows, s), "bad_forces") for s in ours])
    return table(["in every step, the worst of all", "newton may"] + ours, body)


def outcome_table(rows, solvers):
    body = []
    for s in solvers:
        mine = of_solver(rows, s)
        held = [r for r in mine if r["outcome"] == "held"]
        slip = np.array([number(r, "slip_mm") for r in held] or [0.0])
        agree = sum(of["newton"]["outcome"] == of[s]["outcome"] for of in by_seed(rows).values() if s in of)
        body.append([s, len(mine), len(held), len(mine) - len(held), f"{agree} of {len(mine)}", f"{np.median(slip):.4f}",
                     f"{np.percentile(slip, 90):.3f}", f"{slip.max():.2f}"])
    return table(["solver", "grasps", "held", "dropped", "as newton", "slip of the held, mm: median", "90 %", "most"], body)


def dispute_table(found, solvers):
    body = []
    for (family, seed), of in found:
        r = of["newton"]
        body.append([family, seed, r["script"], r["shape"], r["mass_kg"], r["mu"]] + [of[s]["outcome"] if s in of else "" for s in solvers])
    return table(["family", "seed", "script", "object", "kg", "mu"] + list(solvers), body)


# ---- plots --------------------------------------------------------------------------------------------------------
def draw_outcomes(ax, rows, found):
    newton = of_solver(rows, "newton")
    for outcome, mark in (("held", "o"), ("dropped", "x")):
        mine = [r for r in newton if r["outcome"] == outcome]
        ax.plot([number(r, "mass_kg") for r in mine], [number(r, "mu") for r in mine], mark, ms=4, label=f"{outcome} ({len(mine)})")
    at = [of["newton"] for _, of in found]
    ax.plot([number(r, "mass_kg") for r in at], [number(r, "mu") for r in at], "o", ms=12, mfc="none", mec="k", label=f"disputed ({len(at)})")
    ax.set_xscale("log")
    ax.set_xlabel("mass, kg")
    ax.set_ylabel("mu")
    ax.set_title("newton's outcome; circles: solvers differ")
    ax.legend()


def draw_slip(ax, rows, solvers):
    for s in solvers:
        slip = np.sort([max(number(r, "slip_mm"), 1e-4) for r in of_solver(rows, s) if r["outcome"] == "held"])
        if len(slip):
            ax.plot(slip, np.arange(1, len(slip) + 1) / len(slip), color=COLORS[s], label=s)
    ax.set_xscale("log")
    ax.set_xlabel("slip in the palm while held, mm")
    ax.set_ylabel("share of the held grasps")
    ax.set_title("slip in 3 to 4 s")
    ax.legend()


def draw_shares(ax, rows, solvers):
    groups = sorted({(r["script"], r["shape"] if r["shape"] in ("box", "ball") else "compiled") for r in rows})
    for k, s in enumerate(solvers):
        shares = []
        for script, kind in groups:
            mine = [r for r in of_solver(rows, s) if r["script"] == script and (r["shape"] if r["shape"] in ("box", "ball") else "compiled") == kind]
            shares.append(100.0 * sum(r["outcome"] == "held" for r in mine) / max(1, len(mine)))
        ax.bar(np.arange(len(groups)) + 0.2 * (k - 1.5), shares, 0.18, color=COLORS[s], label=s)
    ax.set_xticks(range(len(groups)), [f"{a}\n{b}" for a, b in groups], fontsize=7)
    ax.set_ylabel("held, %")
    ax.set_title("by script and object")
    ax.legend()


def draw_cone(ax, rows, solvers):
    for s in solvers:
        share = np.sort([100.0 * int(r["outside"]) / max(1, int(r["loaded"])) for r in of_solver(rows, s)])
        if s != "mujoco" and len(share):
            ax.plot(share, np.arange(1, len(share) + 1) / len(share), color=COLORS[s], label=s)
    ax.set_xlabel("contacts outside Coulomb's cone, % of a grasp's")
    ax.set_ylabel("share of the grasps")
    ax.set_xscale("symlog", linthresh=0.01)
    ax.set_title("friction beyond mu times the same step's normal force")
    ax.legend()


def draw(path, rows, solvers, found):
    fig, ax = plt.subplots(2, 2, figsize=(13, 9))
    draw_outcomes(ax[0][0], rows, found)
    draw_slip(ax[0][1], rows, solvers)
    draw_shares(ax[1][0], rows, solvers)
    draw_cone(ax[1][1], rows, solvers)
    fig.tight_layout()
    fig.savefig(path, dpi=90)


# ---- page ---------------------------------------------------------------------------------------------------------
STYLE = "body{font:15px sans-serif;max-width:70em;margin:2em auto}table{border-collapse:collapse}td,th{border:1px solid #bbb;padding:2px 8px;text-align:left}"


def page(call, rows, absent, broken, found, solvers):
    verdict = "All promises kept." if not broken else f"{len(broken)} promises broken:"
    parts = [f"<!doctype html><meta charset=utf-8><title>gloved: campaign</title><style>{STYLE}</style><h1>Campaign</h1>",
             f"<p><code>{html.escape(call)}</code>: {len(by_seed(rows))} grasps, {absent} left out because their shape is not compiled here "
             "(<code>make scenes</code>). One again: <code>build/gcc-O2/test/campaign_alone FAMILY SEED 1 dantzig quickstep</code>.</p>",
             f"<h2>Promises</h2><p>{verdict}</p>", "".join(f"<p>{html.escape(b)}</p>" for b in broken[:50]), rules_table(rows, solvers),
             "<p>The rules of contact are judged on the solver's own answers; newton's softened steps apart, where what sticks may creep. "
             "Dantzig and QuickStep are shown, not judged by them: their friction is ODE's.</p>",
             "<h2>Outcomes</h2>", outcome_table(rows, solvers), "<p>Held: at the end at least half as high as the wrist was lifted. All "
             "solvers get the frames that the device sent to newton, MuJoCo the same drivers and springs.</p>",
             f"<h2>Where they differ</h2>{dispute_table(found, solvers)}", '<p><img src="campaign.png" style="max-width:100%"></p>']
    return "\n".join(parts) + "\n"


def main():
    call, out, paths = sys.argv[1], sys.argv[2], sys.argv[3:]
    rows, absent = read_rows(paths)
    solvers = [s for s in SOLVERS if of_solver(rows, s)]
    broken, found = judge(rows), disputes(rows)
    draw(os.path.join(os.path.dirname(os.path.abspath(out)), "campaign.png"), rows, solvers, found)
    open(out, "w").write(page(call, rows, absent, broken, found, solvers))
    newton = of_solver(rows, "newton")
    for s in solvers:
        mine = of_solver(rows, s)
        print(f"campaign: {s}: {sum(r['outcome'] == 'held' for r in mine)} of {len(mine)} held")
    print(f"campaign: newton: {total(newton, 'loaded')} loaded contacts, {total(newton, 'outside')} outside the cone, friction at most "
          f"{worst(newton, 'astray_deg'):.2f} degrees off the slip; {total(newton, 'others')} of {total(newton, 'steps')} steps left to another solver")
    print(f"campaign: {len(found)} grasps disputed, {absent} absent; {len(broken)} promises broken; {os.path.abspath(out)}")
    for b in broken[:50]:
        print(f"campaign: BROKEN {b}", file=sys.stderr)
    if broken:
        os.rename(out, out.replace("index.html", "broken.html"))
        sys.exit(1)


if __name__ == "__main__":
    main()
