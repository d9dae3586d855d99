# SPDX-License-Identifier: BSD-3-Clause
"""The report is of its tables: doc/report.md is made of data/report and data/bench as they are committed, every figure of the README
that has its source there is that source's, and a grasp done now is as good as its row says."""
import os
import subprocess
import sys

import pytest

sys.path.insert(0, "test/report")
import report  # noqa: E402 (test/report is no package)

B = os.environ.get("B", "build/gcc-O2")


@pytest.fixture(scope="module")
def figures():
    return report.Figures()


def test_page_is_made_of_the_committed_tables(figures):
    with open(report.PAGE, encoding="utf-8") as file:
        assert file.read() == report.page(figures), "doc/report.md is older than its tables; make report, or test/report/report.py alone"


def test_every_figure_of_the_readme_is_its_source_s(figures):
    wanted = list(report.readme(figures))
    assert len(wanted) > 12
    assert not report.missing(figures), "the README should say these, as data/report and data/bench do"


def test_pictures_are_there(figures):
    for name in ("rate", "force", "couplings"):
        assert os.path.getsize(f"data/pictures/report-{name}.svg") > 1000


@pytest.mark.parametrize("device", ("best", "real"))
@pytest.mark.parametrize("preset", report.PRESETS)
def test_a_grasp_now_is_as_good_as_its_row(figures, preset, device, tmp_path):
    conf = tmp_path / "preset.conf"
    conf.write_text(f'version = 1;\npreset = "{preset}";\n')
    call = [f"{B}/test/report_grasp", str(conf), "data/scripts/power_box.user", "data/scenes/box.scene", "box", device, "1", "1"]
    head, line = subprocess.run(call, capture_output=True, text=True, check=True).stdout.splitlines()
    now, row = dict(zip(head.split(","), line.split(","))), figures.run(preset, "box", device)
    assert now["held"] == "1"
    for column, spare in (("slip_mm", 0.05), ("way_mm", 0.05), ("tilt_deg", 0.05), ("depth_mm", 0.05), ("std_n", 0.002)):
        assert float(now[column]) <= float(row[column]) + spare, f"{column}: {now[column]}, the table's worst seed has {row[column]}; make report"
