# SPDX-License-Identifier: BSD-3-Clause
"""How the C reads: no line beyond 110 columns (tests and tools, too), and few words on each: in src, include and drivers
the median is at most 10 tokens a code line, and the mean not much more."""
import re
import statistics
import subprocess

TOKEN = re.compile(r'[A-Za-z_]\w*|\d[\w.]*|"(?:\\.|[^"])*"|[-+*/%=<>!&|^]+|[^\s\w]')
COLUMNS, MEDIAN, MEAN = 110, 10.0, 10.5


def sources(*folders):
    found = subprocess.run(["find", *folders, "-name", "*.[ch]"], capture_output=True, text=True, check=True).stdout.split()
    assert len(found) > 10
    return sorted(found)


def code_lines(path):
    with open(path, encoding="utf-8") as file:
        lines = [re.sub(r"//.*", "", line) for line in file]
    return [line for line in lines if line.strip() and not line.lstrip().startswith("#")]


def test_no_line_is_wider_than_110_columns():
    wide = []
    for path in sources("src", "include", "drivers", "tools", "test"):
        with open(path, encoding="utf-8") as file:
            wide += [f"{path}:{number}" for number, line in enumerate(file, 1) if len(line.rstrip("\n")) > COLUMNS]
    assert not wide, f"make format, or break these by hand: {wide[:10]}"


def test_lines_hold_few_tokens():
    for folder in ("src", "include", "drivers"):
        counts = [len(TOKEN.findall(line)) for path in sources(folder) for line in code_lines(path)]
        mean, median = statistics.mean(counts), statistics.median(counts)
        print(f"figure {folder}: {mean:.2f} tokens a code line, median {median:g}, {len(counts)} lines")
        assert median <= MEDIAN and mean <= MEAN, f"{folder}: mean {mean:.2f}, median {median:g}"
