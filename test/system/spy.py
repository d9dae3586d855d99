# SPDX-License-Identifier: BSD-3-Clause
"""lcm-spy as a person sees it, on a display in memory: the picture ($B/test/view/spy.png) is read by OCR. Not part
of `make test`: make test-spy."""
import os
import re
import subprocess
import sys
import time

B = os.environ["B"]
URL = "udpm://239.255.76.67:7782?ttl=0"  # a port of its own
DISPLAY = ":78"
PICTURE = os.path.join(B, "test", "view", "spy.png")
failed = False


def verdict(name, why):
    global failed
    print(f"ok {name}" if not why else f"  {why}\nFAIL {name}", flush=True)
    failed |= bool(why)


def take_picture():
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    environment = dict(os.environ, DISPLAY=DISPLAY, LCM_DEFAULT_URL=URL, JAVA_OPTIONS="-Dsun.java2d.uiScale=2")
    running = [subprocess.Popen(["Xvfb", DISPLAY, "-screen", "0", "1600x900x24"], **quiet)]
    try:
        time.sleep(1.5)
        running.append(subprocess.Popen(["tools/spy"], env=environment, **quiet))
        time.sleep(4)
        running.append(subprocess.Popen([B + "/gloved", "--fcu", "sim:data/scripts/power_box.user", "--no-rt", "--lcm", URL, "--duration", "12"], **quiet))
        time.sleep(7)
        os.makedirs(os.path.dirname(PICTURE), exist_ok=True)
        subprocess.run(["import", "-window", "root", PICTURE], env=environment, check=True)
    finally:
        for process in reversed(running):
            process.terminate()
            process.wait()


def main():
    take_picture()
    text = subprocess.run(["tesseract", PICTURE, "-", "--psm", "6"], capture_output=True, text=True, check=True).stdout
    rows = {name: next((line for line in text.splitlines() if line.startswith(name)), "") for name in ("GLOVED_STATE", "GLOVED_STATS", "GLOVED_EVENT")}
    for name, row in rows.items():
        verdict(f"spy_decodes_{name}", "" if row and "??" not in row and re.search(r"[|\s\]\[][0Oo]\s*$", row) else f"{row!r} in\n{text}")
    rate = re.search(r"\s(\d+\.\d+)[\s|]", rows["GLOVED_STATE"])
    verdict("spy_shows_50_hz", "" if rate and 40 < float(rate[1]) < 60 else f"{rows['GLOVED_STATE']!r}")
    return 1 if failed else 0


sys.exit(main())
