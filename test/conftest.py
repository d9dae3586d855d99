# SPDX-License-Identifier: BSD-3-Clause
"""pytest says TAP: a line for each test behind what the test printed, with the reason where one failed or was skipped."""
count = 0


def tell(report):
    """The verdict of a test, of what it needs, or of a whole file that could not be read."""
    global count
    if report.passed and getattr(report, "when", "") != "call":
        return
    count += 1
    name, why = report.nodeid.split("::")[-1], ""
    if report.skipped:
        why = " # SKIP " + report.longrepr[2].removeprefix("Skipped: ")
    if report.failed:
        print("".join(f"#   {line}\n" for line in report.longreprtext.splitlines()), end="")
    print(f"{'not ok' if report.failed else 'ok'} - {name}{why}", flush=True)


def pytest_runtest_logreport(report):
    tell(report)


def pytest_collectreport(report):
    tell(report)


def pytest_sessionfinish():
    print(f"1..{count}")
