#!/usr/bin/env python3
"""Containers for the network: small, the same for any number of threads, and their claims hold."""
import filecmp
import json
import os

from building import build, must, run_tests, write_grid_obj

MOST_BYTES = 4.0  # a triangle of a smooth surface, all levels, positions and normals
TRIANGLES = 60000


def scene(folder):
    path = os.path.join(folder, "scene.ply")
    must("scene", "isosurface", "-n", str(TRIANGLES), "--seed", "3", "-o", path)
    return path


def a_compact_container_is_small_and_its_claims_hold(folder):
    source, plain, compact = scene(folder), os.path.join(folder, "plain.stroll"), os.path.join(folder, "compact.stroll")
    before, after = build(source, plain), build(source, compact, "--compact")
    assert after["bytes_out"] <= MOST_BYTES * after["triangles_in"], after
    assert after["bytes_out"] < 0.8 * before["bytes_out"], (before["bytes_out"], after["bytes_out"])
    assert after["step"] > before["step"] and after["quantisation_error"] > 0.86 * after["step"], after
    info = json.loads(must("info", compact, "--json").output)
    assert info["trees"][0]["step"] == after["step"], info["trees"][0]
    report = json.loads(must("verify", compact, "--against", source, "--json").output)
    assert report["ok"] and report["claimed_over_measured_least"] >= 1, report
    finest = report["uniform_cuts"][0]
    assert finest["claimed"] >= after["quantisation_error"] * 0.999, (finest, after)


def threads_do_not_show(folder):
    source, outputs = scene(folder), []
    for jobs in (1, 2, 5):
        outputs.append(os.path.join(folder, f"{jobs}.stroll"))
        build(source, outputs[-1], "--compact", "--jobs", str(jobs))
    assert all(filecmp.cmp(outputs[0], other, shallow=False) for other in outputs[1:])


def a_step_that_is_asked_for_is_kept(folder):
    source, output = os.path.join(folder, "grid.obj"), os.path.join(folder, "grid.stroll")
    write_grid_obj(source, 40)
    assert build(source, output, "--compact", "--grid", "0.001")["step"] == 2 ** -10
    chosen = build(source, output, "--compact")["step"]
    assert 1 / 64 < chosen <= 1.5 / 32, chosen  # a 32nd of the median edge, rounded down to a power of two


run_tests(a_compact_container_is_small_and_its_claims_hold, threads_do_not_show, a_step_that_is_asked_for_is_kept)
