#!/usr/bin/env python3
"""A plane with a detailed picture keeps 30 dB at one pixel of error; the same plane in one colour needs next to no
triangles."""
import json
import os

from building import build, check_result, must, run, run_tests, sanitizers

SIZE = "640x360"
TRIANGLES = "200K" if sanitizers() else "1M"


def cameras(folder):
    """From the front, oblique, along the plane, and close to each quarter of the picture."""
    frames = [{"eye": [0.5, 0.5, 1.0], "target": [0.5, 0.5, 0], "up": [0, 1, 0]},
              {"eye": [0.5, 0.5, 1.9], "target": [0.5, 0.5, 0], "up": [0, 1, 0]},
              {"eye": [0.5, -0.7, 0.6], "target": [0.5, 0.5, 0], "up": [0, 0, 1]},
              {"eye": [1.3, 1.2, 0.4], "target": [0.4, 0.5, 0], "up": [0, 0, 1]}]
    for x in (0.25, 0.75):
        for y in (0.25, 0.75):
            frames.append({"eye": [x, y, 0.35], "target": [x, y, 0], "up": [0, 1, 0]})
    path = os.path.join(folder, "cameras.json")
    with open(path, "w") as file:
        json.dump({"fov_y_deg": 60, "frames": frames}, file)
    return path, len(frames)


def make(folder, scene):
    source, model = (os.path.join(folder, name) for name in ("plane.ply", "plane.stroll"))
    must("scene", scene, "--triangles", TRIANGLES, "-o", source, "--quiet")
    result = build(source, model)
    check_result(result)
    return source, model, result


def triangles_drawn(folder, model, path, frames, *more):
    stats = os.path.join(folder, "stats.jsonl")
    must("render", model, "--path", path, "--size", SIZE, "--error", "1", "--stats", stats, "--quiet", *more)
    with open(stats) as file:
        counts = [json.loads(line)["triangles"] for line in file]
    assert len(counts) == frames
    return counts


def a_painted_plane_keeps_its_picture(folder):
    source, model, _ = make(folder, "painted-plane")
    path, frames = cameras(folder)
    reference = os.path.join(folder, "reference")
    must("render", source, "--full", "--path", path, "--size", SIZE, "--supersample", "4", "--depth", "-o",
         reference, "--quiet")
    counts = triangles_drawn(folder, model, path, frames, "--supersample", "4", "--depth", "-o", os.path.join(folder, "drawn"))
    done = run("compare", reference, os.path.join(folder, "drawn"), "--error", "1", "--psnr", "30", "--json")
    print(done.output.strip()[:600], counts, flush=True)
    assert done.code == 0, done
    assert max(counts) > 2000 # a picture cannot be had for nothing


def a_plain_plane_ends_in_a_few_triangles(folder):
    _, model, result = make(folder, "plain-plane")
    path, frames = cameras(folder)
    counts = triangles_drawn(folder, model, path, frames, "--backend", "null")
    print("root", result["root_triangles"], "drawn", counts, flush=True)
    assert result["root_triangles"] < 200
    assert max(counts) < 200


if sanitizers():
    run_tests(a_plain_plane_ends_in_a_few_triangles)
run_tests(a_painted_plane_keeps_its_picture, a_plain_plane_ends_in_a_few_triangles)
