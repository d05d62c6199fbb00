"""Reads exported trajectories with PedPy; prints its frame rate and all rows."""

import json
import pathlib
import sys

import pedpy

read = pedpy.load_trajectory_from_txt(trajectory_file=pathlib.Path(sys.argv[1]))
rows = read.data[["id", "frame", "x", "y"]].sort_values(["frame", "id"])
print(json.dumps({"frame_rate": read.frame_rate, "rows": rows.values.tolist()}))
