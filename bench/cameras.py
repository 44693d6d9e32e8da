"""Paths of cameras about a model, as files for `stroll render --path`. Standard library only."""
import json
import math


def write_turns(path, bounds, places):
    """Looks at the middle of the box from each of `places`: an angle about z, and how far off and above in radii of the box."""
    low, high = bounds[:3], bounds[3:]
    centre, radius = [(a + b) / 2 for a, b in zip(low, high)], math.dist(low, high) / 2
    frames = [{"eye": [centre[0] + radius * off * math.cos(angle), centre[1] + radius * off * math.sin(angle), centre[2] + radius * above],
               "target": centre, "up": [0, 0, 1]} for angle, off, above in places]
    path.write_text(json.dumps({"fov_y_deg": 60, "frames": frames}), encoding="utf-8")
