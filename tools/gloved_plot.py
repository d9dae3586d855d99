#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""gloved-plot LOG [--out FOLDER] - pictures of a run from its LCM log (gloved --log): force per finger with the contact
phases, penetration, joint angles, object poses, step and wake times, energy of the coupling. Writes PNG, PDF
and SVG, index.html, CSV tables and an MCAP file. gloved-plot --compare A B lays two runs over each other.
Needs `pip install lcm numpy matplotlib mcap` (make plot LOG=FILE does it)."""
import argparse
import csv
import html
import json
import os
import sys

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from gloved_figures import draw  # noqa: E402
from gloved_run import FINGERS, PARTS, SAFETY, SENSORS, Run  # noqa: E402

STYLE = "body{font-family:sans-serif;max-width:60em;margin:2em auto;padding:0 1em}img{max-width:100%}td{padding:.1em 1.5em .1em 0}td+td{font-family:monospace}"


def difference_table(runs):
    """Rows of HTML: what, A, B, B less A; of what both runs have."""
    cell = lambda text: f"<td>{html.escape(text)}</td>"
    b = {what: value for what, _, value in runs[1].numbers()}
    rows = [f"<tr><th>{''.join(f'<th>{html.escape(run.stem)}' for run in runs)}<th>difference"]
    for what, unit, value in runs[0].numbers():
        if what in b:
            numbers = (f"{x:.4g} {unit}".strip() for x in (value, b[what]))
            rows.append("<tr>" + cell(what) + "".join(map(cell, numbers)) + cell(f"{b[what] - value:+.4g} {unit}".strip()))
    return "<table>" + "".join(rows) + "</table>"


def write_html(path, runs, pictures):
    cell = lambda text: f"<td>{html.escape(text)}</td>"
    out = [f"<!doctype html><meta charset=utf-8><title>gloved: {html.escape(runs[0].name)}</title><style>{STYLE}</style>"]
    for number, run in enumerate(runs):
        title = run.name if len(runs) == 1 else f"{'AB'[number]}: {run.name}"
        out.append(f"<h1>{html.escape(title)}</h1><table>" + "".join(f"<tr>{cell(a)}{cell(b)}" for a, b in run.figures()) + "</table>")
    if len(runs) == 2:
        out.append("<h1>Difference</h1>" + difference_table(runs))
    out += [f"<h2>{html.escape(text)}</h2><img src='{name}.png' alt='{name}'><p><a href='{name}.pdf'>PDF</a> <a href='{name}.svg'>SVG</a>"
            for name, text in pictures]
    for run in runs:
        out.append(f"<h2>Events of {html.escape(run.name)}</h2><table>" + "".join(f"<tr>{cell(f'{e.time_s:.3f} s')}{cell(e.text)}" for e in run.events) + "</table>")
    with open(path, "w", encoding="utf-8") as file:
        file.write("\n".join(out) + "\n")


def rounded(value):
    """A tenth of a microsecond, a nanometre, a micronewton: more digits than any of them has a meaning for."""
    return f"{value:.7g}" if isinstance(value, float) else value


def write_table(path, header, rows):
    with open(path, "w", newline="", encoding="ascii") as file:
        writer = csv.writer(file)
        writer.writerow(header)
        writer.writerows([rounded(value) for value in row] for row in rows)


def write_csv(folder, run):
    """state.csv: 50 rows a second; steps.csv: every step, where the log has GLOVED_TRACE."""
    header = ["time_s", "safety"] + [f"{kind}_{f}_n" for kind in ("commanded", "desired", "measured") for f in FINGERS]
    header += [f"{s}_rad" for s in SENSORS] + [f"depth_{p}_m" for p in PARTS] + [f"contact_force_{p}_n" for p in PARTS] + [f"energy_{p}_j" for p in PARTS] + [f"given_{f}_j" for f in FINGERS]
    header += [f"{name}_{axis}" for name in run.objects for axis in ("x_m", "y_m", "z_m", "turned_rad")]
    rows = []
    for i, t in enumerate(run.t):
        objects = [value for k in range(len(run.objects)) for value in (*run.position[i, k], run.turned[i, k])]
        rows.append([t, SAFETY[run.safety[i]], *run.commanded[i], *run.desired[i], *run.measured[i], *run.angle[i], *run.depth[i],
                     *run.contact_force[i], *run.energy[i], *-run.port_energy[i], *objects])
    write_table(f"{folder}/state.csv", header, rows)
    if run.step_work_us is None:
        return
    header = ["time_s", "work_us", "wake_us", "depth_m"] + [f"{kind}_{f}_n" for kind in ("commanded", "desired") for f in FINGERS]
    write_table(f"{folder}/steps.csv", header, ([t, run.step_work_us[i], run.step_wake_us[i], run.step_depth[i], *run.step_commanded[i], *run.step_desired[i]]
                                                for i, t in enumerate(run.step_t)))


def plain(message):
    """An LCM message as what JSON can say."""
    if hasattr(message, "__slots__"):
        return {name: plain(getattr(message, name)) for name in message.__slots__}
    if isinstance(message, (list, tuple)):
        return [plain(item) for item in message]
    if isinstance(message, (bytes, bytearray)):
        return message.hex()
    return message if message == message else None  # JSON has no not-a-number


def write_mcap(path, run):
    """State, statistics and events as JSON messages, for Foxglove and others."""
    from mcap.writer import Writer
    with open(path, "wb") as file:
        writer = Writer(file)
        writer.start(profile="", library="gloved-plot")
        for channel, messages in (("GLOVED_STATE", run.states), ("GLOVED_STATS", run.stats), ("GLOVED_EVENT", run.events)):
            schema = writer.register_schema(name=channel, encoding="jsonschema", data=b'{"type": "object"}')
            number = writer.register_channel(topic="/" + channel.lower(), message_encoding="json", schema_id=schema)
            for message in messages:
                writer.add_message(channel_id=number, log_time=message.utime * 1000, publish_time=message.utime * 1000,
                                   data=json.dumps(plain(message)).encode())
        writer.finish()


def main():
    parser = argparse.ArgumentParser(prog="gloved-plot", description=__doc__.split(" - ", 1)[1])
    parser.add_argument("log", nargs="?", help="LCM log of a run")
    parser.add_argument("--compare", nargs=2, metavar=("A", "B"), help="two logs")
    parser.add_argument("--out", help="folder for what is written (LOG-plots)")
    args = parser.parse_args()
    if bool(args.log) == bool(args.compare):
        parser.error("give one LOG, or --compare A B")
    runs = [Run(path) for path in args.compare or [args.log]]
    first = os.path.splitext((args.compare or [args.log])[0])[0]
    folder = args.out or (f"{first}-and-{runs[1].stem}" if args.compare else first + "-plots")
    os.makedirs(folder, exist_ok=True)
    write_html(f"{folder}/index.html", runs, draw(runs, folder))
    if not args.compare:
        write_csv(folder, runs[0])
        write_mcap(f"{folder}/run.mcap", runs[0])
    print(f"{folder}/index.html")


if __name__ == "__main__":
    main()
