#!/usr/bin/env python3
"""`rover.py` without the package, for `cars exec`: lines of JSON."""

import json
import math
import sys

backward = 0
for line in sys.stdin:
    told = json.loads(line)
    if told["type"] == "end":
        break
    if told["type"] == "init":
        backward = 0
        if told["tick"] > 0:
            continue
    if told.get("blocked"):
        backward = 3

    if backward > 0:
        backward -= 1
        velocity = (-0.5, 0.7)
    elif told["tick"] % 20 < 12:
        velocity = (0.9, 0.4)
    else:
        velocity = (0.6, -1.1)
    linear_mps, angular_radps = velocity
    done = {
        "type": "done",
        "velocity": {"linear_mps": linear_mps, "angular_radps": angular_radps},
        "speed_mps": abs(linear_mps),
    }
    if "pose" in told:
        heading_rad = told["pose"]["heading_rad"]
        turned = 0.0 if linear_mps >= 0.0 else math.copysign(math.pi, -heading_rad)
        done["direction_rad"] = heading_rad + turned
        done["state_variables"] = {"heading_rad": heading_rad, **told["pose"]["velocity"]}
    print(json.dumps(done), flush=True)
