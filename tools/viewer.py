#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""viewer.py [--port N] [--settings FILE] - Drake's viewer (Meldis) with the camera where the hand is: shows in a
browser what gloved publishes on DRAKE_VIEWER_LOAD_ROBOT and DRAKE_VIEWER_DRAW. Runs until it is interrupted.
Needs `pip install drake` (make view does it). LCM_DEFAULT_URL says where to listen."""
import argparse
import json
import logging

import numpy as np
from pydrake.geometry import MeshcatParams
from pydrake.visualization._meldis import Meldis


def main():
    parser = argparse.ArgumentParser(description=__doc__.split(" - ")[1])
    parser.add_argument("--host", default="localhost", help="'*': other machines may look, too")
    parser.add_argument("--port", type=int, default=7000)
    parser.add_argument("--settings", default="data/viewer/viewer.json", help="the camera: eye and target, metres in the world of the scene")
    args = parser.parse_args()
    with open(args.settings, encoding="utf-8") as file:
        camera = json.load(file)
    logging.getLogger("drake").setLevel(logging.WARNING)
    try:
        meldis = Meldis(meshcat_params=MeshcatParams(host=args.host, port=args.port, show_stats_plot=False))
    except RuntimeError as error:
        raise SystemExit(f"viewer: port {args.port} or LCM is not to be had ({error}); choose another --port, "
                         "or give this machine a multicast route (ip route add 224.0.0.0/4 dev lo)")
    meldis.meshcat.SetCameraPose(np.array(camera["eye"]), np.array(camera["target"]))
    for path in ("/Axes", "/Grid"):
        meldis.meshcat.SetProperty(path, "visible", False)
    print(f"viewer: open {meldis.meshcat.web_url()}", flush=True)
    try:
        meldis.serve_forever()
    except KeyboardInterrupt:
        pass


if __name__ == "__main__":
    main()
