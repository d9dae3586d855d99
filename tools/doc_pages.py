# SPDX-License-Identifier: BSD-3-Clause
"""doc_pages.py BUILD [FOLDER] - the pages of doc/ that are tables of what stands elsewhere once: configuration.md from the
settings' own table (BUILD/test/settings_pipe), wire.md from data/gloved.dbc, lcm.md from data/lcm. Without FOLDER into doc/.
`make doc` runs it; test_doc compares. Needs `pip install cantools`."""
import glob
import os
import re
import subprocess
import sys
import textwrap

import cantools

MADE = "<!-- Made by `make doc`; edit {}, not this page. -->\n"
WIDTH = 118


def cell(text):
    return str(text).replace("|", "\\|").strip()


def table(head, rows):
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    return "\n".join(lines + ["| " + " | ".join(cell(c) for c in row) + " |" for row in rows]) + "\n"


def paragraph(text):
    return textwrap.fill(" ".join(text.split()), WIDTH, break_long_words=False, break_on_hyphens=False) + "\n"


# ---- configuration ----------------------------------------------------------------------------------------

GROUPS = {
    "": ("At the top of the file", "What runs, and with what. Options of the command line win over these."),
    "realtime": ("realtime", "How the loop lives on this machine: `doc/real-time.md`."),
    "filter": ("filter", "What becomes of the samples before the hand follows them: `doc/tuning.md`."),
    "finger": ("finger", "The user's fingers, as a tension bends them: `doc/tuning.md`."),
    "coupling": ("coupling", "Spring and damper between the measured hand and the simulated one (Eqn 1 to 4 of the paper)."),
    "coupling.limb": ("coupling.limb", "Of each of the fifteen finger limbs; inside `coupling`, as `limb = { ... };`."),
    "coupling.palm": ("coupling.palm", "Of the palm; inside `coupling`, as `palm = { ... };`."),
    "contact": ("contact", ""),
    "solver": ("solver", "`solver = \"newton\";` is short for `solver = { method = \"newton\"; };`."),
    "override": ("override", "In place of what the scene says (the paper's Table 1). 0 or false: as the scene says."),
    "limiter": ("limiter", "The last gate of every force. Lower these for a first try with a new device."),
    "safety": ("safety", "What ends in a fault, with forces brought to zero until the dead-man switch was let go."),
    "passivity": ("passivity", "A damper for a force that swings: `doc/tuning.md`. The energy at the tendons is watched and told in any case."),
}
LAXER = {"0": "", "1": "above", "2": "below"}


def bounds(row):
    if row["words"]:
        return row["words"].replace('"', "`")
    if row["kind"] in ("text", "bool"):
        return ""
    return f"{float(row['least']):g} to {float(row['most']):g}"


def configuration(build):
    out = subprocess.run([build + "/test/settings_pipe"], stdout=subprocess.PIPE, text=True, check=True).stdout
    names = ("group", "key", "kind", "default", "least", "most", "laxer", "words", "sentence")
    rows = [dict(zip(names, line.split("\t"))) for line in out.splitlines()]
    parts = [MADE.format("the settings' tables in src/"), "# Configuration\n",
             paragraph("A configuration is a text file: `gloved --config FILE`. `gloved --print-config > my.conf` writes one with every setting at "
                       "its default and its meaning; delete what you do not need. What is left out keeps its default, or the value of the `preset`. A "
                       "wrong key or value is answered with file, line, and what is known there; `gloved --check --config FILE` reads it without "
                       "running anything. What is in force in a running gloved: `gloved-command get limiter.max_n`."),
             paragraph("The bounds are hard: no file passes them. Where a column *protects less* says `above` or `below`, a value on that side of the "
                       "default protects a person less than the default does, and is told at every start, in the summary and in `GLOVED_STATS`."),
             "```\nversion = 1;\npreset = \"default\";   # or \"stock\", \"paper\"\nlimiter = { max_n = 1.2; };   # a tenth of the force, for a first try\n```\n"]
    for group, (title, says) in GROUPS.items():
        mine = [row for row in rows if row["group"] == group]
        safe = any(row["laxer"] != "0" for row in mine)
        head = ["setting", "default", "bounds"] + (["protects less"] if safe else []) + ["meaning"]
        cells = [[f"`{r['key']}`", f"`{r['default']}`", bounds(r)] + ([LAXER[r["laxer"]]] if safe else []) + [r["sentence"] or meaning(r, rows)]
                 for r in mine]
        parts += [f"## {title if group == '' else f'`{title}`'}\n", paragraph(says) if says else "", table(head, cells)]
    parts += ["## `hand`, `receiver`, `tracker_to_world`\n",
              paragraph("Measures of the person's hand (lengths and thickness of the segments, where each finger begins, the palm, the limits of the "
                        "joints), where the tracker's receiver sits on the wrist, and where a tracker of its own stands. They are lists rather than "
                        "single values: `gloved --print-config` writes them with a comment each.")]
    return "\n".join(p for p in parts if p)


def meaning(row, rows):
    """The palm's rows are the limb's; the sentence stands there once."""
    if row["key"] == "mass_kg":
        return "kg"
    if row["key"] == "scene":
        return "file, or a name such as `box`"
    twin = [r for r in rows if r["key"] == row["key"] and r["sentence"]]
    return twin[0]["sentence"] if twin else ""


# ---- wire -------------------------------------------------------------------------------------------------

def bits(signal):
    return f"{signal.start} + {signal.length}"


def step(signal):
    unit = signal.unit or ""
    if signal.choices:
        return ", ".join(f"{k} {v}" for k, v in signal.choices.items())
    if signal.scale != 1:
        return f"{signal.scale:g} {unit}".strip()
    return unit


def wire():
    data = cantools.database.load_file("data/gloved.dbc")
    parts = [MADE.format("data/gloved.dbc"), "# Wire format\n",
             paragraph("CAN FD frames with eleven-bit identifiers, the same over UDP (cannelloni) and on a CAN bus. `data/gloved.dbc` says it to other "
                       "people's tools (cantools, SavvyCAN, candump); `include/gloved/fcu.h` packs and unpacks them in C. Numbers are little-endian; "
                       "*bits* are the first one and how many. Flags that are set mean yes. On an interface without FD the same messages travel in parts "
                       "of 8 bytes (`include/gloved/fcu.h`)."),
             paragraph("Every frame has a counter, up by one with each frame of its identifier, and a checksum over identifier and payload (CRC-16/CCITT, "
                       "start 0xFFFF). A stamp is the sender's clock when it measured, an age how long ago that was when the frame left.")]
    parts.append(table(["message", "identifier", "bytes", "from"], [(m.name, f"`0x{m.frame_id:03x}`", m.length, ", ".join(m.senders)) for m in data.messages]))
    for m in data.messages:
        parts.append(f"## {m.name}\n")
        if m.comment:
            parts.append(paragraph(m.comment))
        parts.append(table(["field", "bits", "step, unit", "range", "meaning"],
                           [(f"`{s.name}`", bits(s), step(s), f"{s.minimum:.10g} to {s.maximum:.10g}" if s.length > 1 and s.maximum is not None else "", s.comment or "")
                            for s in m.signals]))
    return "\n".join(parts)


# ---- LCM --------------------------------------------------------------------------------------------------

FIELD = re.compile(r"^\s+(\w+)\s+(\w+)((?:\[\w+\])*);\s*(?://\s*(.*))?$")


def read_type(path):
    """Comment of the head, and (type, field, comment) of each field; a comment line alone heads the fields below it."""
    head, fields, begun = [], [], False
    with open(path, encoding="utf-8") as file:
        for line in file.read().splitlines():
            if line.startswith("struct"):
                begun = True
            elif not begun and line.startswith("//") and "SPDX" not in line:
                head.append(line[2:].strip())
            elif begun and FIELD.match(line):
                kind, name, size, comment = FIELD.match(line).groups()
                fields.append([f"{kind}{size}", name, comment or ""])
            elif begun and line.strip().startswith("//"):
                text = line.strip()[2:].strip()
                if line.startswith("                    ") and fields:
                    fields[-1][2] += " " + text
    return " ".join(head), fields


def lcm():
    parts = [MADE.format("data/lcm"), "# LCM types\n",
             paragraph("What gloved publishes and takes over LCM, one type a message. Make code of them with `lcm-gen -p data/lcm/*.lcm` (also `-c`, `-j`, "
                       "`-x`); installed they lie in `share/gloved/lcm`. The channels are those that the texts below name; nested types have none. SI "
                       "units; quaternions w x y z; fingers from thumb to little finger.")]
    types = {os.path.basename(p)[len("gloved_"):-len(".lcm")]: read_type(p) for p in sorted(glob.glob("data/lcm/*.lcm"))}
    order = sorted(types, key=lambda name: ("Channel" not in types[name][0], name))
    parts.append(table(["type", "what it is"], [(f"[{n}](#{n})", types[n][0].split(". ")[0]) for n in order]))
    for name in order:
        head, fields = types[name]
        parts += [f"## {name}\n", paragraph(head) if head else "", table(["field", "type", "meaning"], [(f"`{f}`", f"`{k}`", c) for k, f, c in fields])]
    return "\n".join(p for p in parts if p)


def main():
    build = sys.argv[1]
    folder = sys.argv[2] if len(sys.argv) > 2 else "doc"
    for name, text in (("configuration.md", configuration(build)), ("wire.md", wire()), ("lcm.md", lcm())):
        with open(os.path.join(folder, name), "w", encoding="utf-8") as file:
            file.write(text)


if __name__ == "__main__":
    main()
