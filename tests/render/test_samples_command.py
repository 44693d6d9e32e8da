#!/usr/bin/env python3
"""stroll on sample trees, from outside: what is refused, what is told of them, and images that end where `--full` is.

usage: test_samples_command.py PROGRAM"""
import base64
import json
import math
import os
import pathlib
import struct
import sys
from random import Random

sys.path[:0] = [os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", folder) for folder in ("build", "support")]
sys.dont_write_bytecode = True
from building import assert_refused, build, must, run, run_tests  # noqa: E402
from png import read_png  # noqa: E402

TRIANGLES = "60K"
CAMERAS = ("eye 9 -7 6 target 0 0 4 up 0 0 1 fov 50", "eye 1 -2 3 target 0 3 5 up 0 0 1 fov 70",
           "eye 60 40 30 target 0 0 0 up 0 0 1 fov 40")
BACKENDS = ("gl45", "gl3", "gles")


def read(path):
    with open(path, "rb") as file:
        return file.read()


def plant(folder):
    source, out = os.path.join(folder, "in.ply"), os.path.join(folder, "out.stroll")
    must("scene", "plant", "--triangles", TRIANGLES, "-o", source, "--quiet")
    return source, out, build(source, out, "--structure", "samples")


def faces(path):
    """Triangles of a binary PLY, each as the places of its corners."""
    data = read(path)
    head, body = data.split(b"end_header\n", 1)
    counts = {words[1]: int(words[2]) for words in (line.split() for line in head.decode().split("\n")) if words[:1] == ["element"]}
    return counts["vertex"], counts["face"], len(body)


def what_samples_cannot_do_is_refused(folder):
    source, out = os.path.join(folder, "in.ply"), os.path.join(folder, "out.stroll")
    must("scene", "boxes", "--triangles", "1K", "-o", source, "--quiet")
    for words, part in ((("--certify",), "--certify"), (("--no-dependencies",), "--no-dependencies"),
                        (("--probability", "0"), "probability"), (("--probability", "1"), "probability"),
                        (("--probability", "-0.5"), "probability"), (("--probability", "nan"), "probability"),
                        (("--memory", "63M"), "memory")):
        done = run("build", source, "-o", out, "--structure", "samples", *words)
        assert done.code != 0 and done.error.count("\n") == 1 and len(done.error) > 20 and part in done.error, done
        assert os.listdir(folder) == ["in.ply"], done
    done = run("build", source, "-o", out, "--probability", "0.5")
    assert done.code == 1 and done.error.count("\n") == 1 and "--probability" in done.error and os.listdir(folder) == ["in.ply"], done
    assert_refused(run("build", os.path.join(folder, "absent.ply"), "-o", out, "--structure", "samples"), "absent.ply")
    for probability in ("0.01", "0.5", "0.999999999999"):
        assert build(source, out, "--structure", "samples", "--probability", probability)["triangles_leaf"] > 900


def info_tells_what_it_is(folder):
    _, out, result = plant(folder)
    tree = json.loads(must("info", out, "--json").output)["trees"][0]
    assert tree["structure"] == "samples" and tree["triangles"] == result["triangles_leaf"] == result["triangles_in"], tree
    assert tree["nodes"] == tree["groups"] == result["nodes"] and tree["root_triangles"] == result["root_triangles"] <= 16384
    assert sum(level["nodes"] for level in tree["per_level"]) == tree["nodes"]
    for level in tree["per_level"]:
        assert level["rungs"]["sampled"] == level["nodes"] and level["steps"] == 0, level
    assert sum(level["triangles"] for level in tree["per_level"]) == tree["triangles"]
    assert "samples" in must("info", out).output


def verify_proves_it_and_not_against_another(folder):
    source, out, _ = plant(folder)
    assert json.loads(must("verify", out, "--json", "--against", source).output)["ok"]
    other = os.path.join(folder, "other.ply")
    must("scene", "plant", "--triangles", TRIANGLES, "--seed", "2", "-o", other, "--quiet")
    done = run("verify", out, "--json", "--against", other)
    assert done.code == 1 and not json.loads(done.output)["ok"], done


def extract_gives_what_is_above_a_front(folder):
    _, out, result = plant(folder)
    mesh, counts = os.path.join(folder, "out.ply"), []
    for error in ("0", "0.1", "0.5", "2", "1000"):
        must("extract", out, "--error", error, "-o", mesh)
        counts.append(faces(mesh)[1])
    assert counts[0] == result["triangles_leaf"], counts
    assert counts == sorted(counts, reverse=True) and counts[-1] >= result["root_triangles"] and counts[-1] < counts[0] / 2, counts


def render(model, folder, *words):
    """Bytes of the image, and what its one line of statistics says."""
    image, stats = os.path.join(folder, "image.png"), os.path.join(folder, "stats.jsonl")
    drawn = () if "null" in words else ("-o", image)
    must("render", model, "--size", "240x180", "--stats", stats, "--quiet", *drawn, *words)
    with open(stats, encoding="utf-8") as file:
        return read(image) if drawn else None, json.loads(file.readlines()[-1])


def as_the_error_goes_to_nothing_the_image_is_the_full_one(folder):
    _, out, result = plant(folder)
    for number, camera in enumerate(CAMERAS):
        for backend in BACKENDS if number == 0 else BACKENDS[:1]:
            words = ("--camera", camera, "--backend", backend)
            full, _ = render(out, folder, "--full", *words)
            image, stats = render(out, folder, "--error", "1e-6", *words)
            assert image == full, (backend, camera)
            assert stats["missing_nodes"] == stats["splats"] == stats["faults"] == 0, stats
            assert stats["triangles"] == result["triangles_leaf"] or stats["nodes_culled"] > 0, stats


def other_errors_draw_fewer_triangles_and_splats(folder):
    _, out, result = plant(folder)
    before = result["triangles_leaf"] + 1
    for error in ("1", "4", "16"):
        image, stats = render(out, folder, "--error", error, "--camera", CAMERAS[2])
        again, _ = render(out, folder, "--error", error, "--camera", CAMERAS[2])
        assert image == again
        assert stats["missing_nodes"] == 0 and stats["triangles"] < before and stats["splats"] > 0, stats
        before = stats["triangles"]
        _, null = render(out, folder, "--error", error, "--camera", CAMERAS[2], "--backend", "null")
        assert (null["triangles"], null["splats"], null["nodes"]) == (stats["triangles"], stats["splats"], stats["nodes"]), null


def splats_are_errors_of_their_size(folder):
    """--splat is what --error would be, of such trees; what is claimed is in pixels of the image."""
    _, out, _ = plant(folder)
    columns = "triangles", "splats", "nodes", "max_error_px"
    for size in ("4", "64"):
        image, splat = render(out, folder, "--camera", CAMERAS[2], "--splat", size)
        other, error = render(out, folder, "--camera", CAMERAS[2], "--error", size)
        assert image == other and all(abs(splat[name] - error[name]) <= 1e-5 * error[name] for name in columns), (splat, error)
        assert 0.5 * float(size) < splat["max_error_px"] <= float(size) * 1.000001 and splat["allowed_error_px"] == 1, splat


def paths_along_the_surface_are_the_same_however_it_is_drawn(folder):
    _, samples, _ = plant(folder)
    clusters, saved = os.path.join(folder, "clusters.stroll"), os.path.join(folder, "path.json")
    build(os.path.join(folder, "in.ply"), clusters)
    for path in ("walk", "flythrough"):
        for model, ways in ((samples, (("--splat", "1"), ("--splat", "8"), ("--full",), ("--realtime", "1000"), ("--cull", "back"))),
                            (clusters, ((), ("--error", "20"), ("--full",), ("--supersample", "2")))):
            found = set()
            for words in ways:
                must("render", model, "--path", path, "--frames", "3", "--size", "64x48", "--save-path", saved, "--quiet", *words)
                found.add(read(saved))
            assert len(found) == 1, (path, model)


def confetti(path, count, reach=0.012):
    """Small white triangles of any direction in a cube, without normals."""
    random = Random(7)
    corners = []
    for _ in range(count):
        at = [random.uniform(-1, 1) for _ in range(3)]
        corners += (at[k] + random.gauss(0, reach) for _ in range(3) for k in range(3))
    head = (f"ply\nformat binary_little_endian 1.0\nelement vertex {3 * count}\nproperty float x\nproperty float y\nproperty float z\n"
            f"element face {count}\nproperty list uchar uint vertex_indices\nend_header\n")
    indices = b"".join(struct.pack("<B3I", 3, 3 * i, 3 * i + 1, 3 * i + 2) for i in range(count))
    with open(path, "wb") as file:
        file.write(head.encode() + struct.pack(f"<{len(corners)}f", *corners) + indices)


def splats_of_confetti_are_as_bright_as_it(folder):
    """In linear light, over the middle of the image, which both cover."""
    source, out = os.path.join(folder, "in.ply"), os.path.join(folder, "out.stroll")
    confetti(source, 60000)
    build(source, out, "--structure", "samples")
    for backend in BACKENDS:
        for eye in ("25 3 2", "0.5 0.2 -25"):
            words = ("--camera", f"eye {eye} target 0 0 0 up 0 1 0 fov 12", "--backend", backend)
            light = []
            for error in ("1e-6", "14"):
                _, stats = render(out, folder, "--error", error, *words)
                light.append(light_of(folder))
            assert stats["splats"] > 100 and 0.88 < light[1] / light[0] < 1.12, (backend, eye, light)


def light_of(folder):
    """Of the middle of the image, linear."""
    middle = [value for row in read_png(pathlib.Path(folder) / "image.png")[70:110] for value in row[3 * 100:3 * 140]]
    return sum((value / 255) ** 2.2 for value in middle) / len(middle)


def placed(path, mesh, places):
    """A glTF of triangles placed many times over."""
    corners = struct.unpack(f"<{len(mesh) // 4}f", mesh)
    uri = "data:application/octet-stream;base64," + base64.b64encode(mesh).decode()
    scene = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": list(range(len(places)))}],
             "nodes": [{"mesh": 0, "translation": place} for place in places],
             "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
             "buffers": [{"uri": uri, "byteLength": len(mesh)}], "bufferViews": [{"buffer": 0, "byteLength": len(mesh)}],
             "accessors": [{"bufferView": 0, "componentType": 5126, "count": len(corners) // 3, "type": "VEC3",
                            "min": [min(corners[k::3]) for k in range(3)], "max": [max(corners[k::3]) for k in range(3)]}]}
    with open(path, "w", encoding="ascii") as file:
        json.dump(scene, file)


def far_copies_of_confetti_are_as_bright_as_near_ones(folder):
    """From every side, as single ones and as runs of them, whichever way the mean of the faces happens to lie."""
    source, mesh, side = os.path.join(folder, "in.gltf"), os.path.join(folder, "mesh.ply"), 12
    confetti(mesh, 400, 0.05)
    corners = read(mesh).split(b"end_header\n", 1)[1][:400 * 36]
    placed(source, corners, [[2.0 * x - side + 1, 2.0 * y - side + 1, 2.0 * z - side + 1]
                             for x in range(side) for y in range(side) for z in range(side)])
    for structure in ("samples", "clusters"):
        out = os.path.join(folder, structure + ".stroll")
        assert build(source, out, "--structure", structure)["placements"] == side ** 3
        must("verify", out, "--quiet")
        for eye in ("0 0 250", "250 0 5", "5 250 5", "-140 140 -140", "140 -140 -30"):
            light, words = [], ("--camera", f"eye {eye} target 0 0 0 up 0.1 1 0 fov 14")
            for error in ("1e-6", "30"):
                _, stats = render(out, folder, "--error", error, *words)
                light.append(light_of(folder))
            assert stats["splats"] > 1000 and stats["triangles"] == 0 and 0.85 < light[1] / light[0] < 1.18, (structure, eye, light)


def ball(path, rings, inward):
    """A closed sphere of radius 1, which a PLY tells counter-clockwise from outside, or from inside."""
    corners, triangles = [], []
    for ring in range(rings + 1):
        for turn in range(2 * rings):
            polar, angle = math.pi * ring / rings, math.pi * turn / rings
            corners += math.sin(polar) * math.cos(angle), math.sin(polar) * math.sin(angle), math.cos(polar)
    for ring in range(rings):
        for turn in range(2 * rings):
            a, b = ring * 2 * rings + turn, ring * 2 * rings + (turn + 1) % (2 * rings)
            triangles += [(a, a + 2 * rings, b + 2 * rings)] * (ring < rings - 1) + [(a, b + 2 * rings, b)] * (ring > 0)
    head = (f"ply\nformat binary_little_endian 1.0\nelement vertex {len(corners) // 3}\nproperty float x\nproperty float y\nproperty float z\n"
            f"element face {len(triangles)}\nproperty list uchar uint vertex_indices\nend_header\n")
    with open(path, "wb") as file:
        file.write(head.encode() + struct.pack(f"<{len(corners)}f", *corners))
        file.write(b"".join(struct.pack("<B3I", 3, *(face[::-1] if inward else face)) for face in triangles))


def backs_are_left_out_on_request(folder):
    """Of the file as read, of a container in full, and of walks through both structures. From outside a closed surface looks as ever, and of
    one that is turned inside out its far half is seen."""
    outside = ("--camera", "eye 3 1 2 target 0 0 0 up 0 0 1 fov 45")
    for inward in (False, True):
        source, samples, clusters = (os.path.join(folder, f"{name}{inward:d}") for name in ("in.ply", "samples.stroll", "clusters.stroll"))
        ball(source, 180, inward)
        build(source, samples, "--structure", "samples")
        build(source, clusters)
        checks = json.loads(must("verify", samples, "--json", "--against", source).output)["checks"]
        assert checks["cones"]["done"] and checks["cones"]["failures"] == 0 and checks["cones"]["count"] > 20, checks["cones"]
        depths = []
        for model, words in ((source, ("--full",)), (samples, ("--full",)), (samples, ("--error", "1e-6")), (clusters, ("--error", "0.5"))):
            for backend in BACKENDS if model == samples else BACKENDS[:1]:
                both, all_of_it = render(model, folder, "--backend", backend, *outside, *words)
                none, _ = render(model, folder, "--backend", backend, "--cull", "none", *outside, *words)
                culled, stats = render(model, folder, "--backend", backend, "--cull", "back", "--depth", *outside, *words)
                assert none == both and (culled != both or not inward), (model, words)
                assert stats["triangles"] <= all_of_it["triangles"] and all_of_it["nodes_backfacing"] == 0, (stats, all_of_it)
                walks = model == samples and "--full" not in words
                assert (stats["nodes_backfacing"] > 0) == walks and (stats["triangles"] < 0.8 * all_of_it["triangles"]) == walks, stats
                assert abs(stats["covered_pixels"] - all_of_it["covered_pixels"]) <= 40, (stats, all_of_it)
                with open(os.path.join(folder, "image.pfm"), "rb") as file:
                    depths.append(struct.unpack(f"<{240 * 180}f", file.read()[-4 * 240 * 180:])[90 * 240 + 120])
        distance = math.sqrt(14) + (1 if inward else -1)
        assert all(abs(depth - distance) < 0.01 for depth in depths), (depths, distance)
    for command in ("render", "view", "bench"):
        done = run(command, *(() if command == "bench" else (samples,)), "--cull", "front")
        assert done.code == 2 and "none|back" in done.error, done


def a_wireframe_shows_splats_as_they_are(folder):
    """ES draws its own lines."""
    _, out, _ = plant(folder)
    for backend in BACKENDS:
        _, stats = render(out, folder, "--error", "4", "--camera", CAMERAS[2], "--wireframe", "--backend", backend)
        assert stats["splats"] > 0 and stats["faults"] == 0, stats


def within_little_memory_it_coarsens(folder):
    _, out, _ = plant(folder)
    _, ample = render(out, folder, "--error", "0.5", "--camera", CAMERAS[0])
    assert ample["resident_bytes"] > 1 << 20, ample
    memory = 1 << 20
    _, stats = render(out, folder, "--error", "0.5", "--camera", CAMERAS[0], "--memory", str(memory))
    assert stats["missing_nodes"] == stats["faults"] == 0 and stats["resident_bytes"] <= memory, stats
    assert stats["allowed_error_px"] > 0.5 and 0 < stats["triangles"] < ample["triangles"], stats


def large_triangles_are_all_drawn_however_many_lie_in_a_cell(folder):
    """Each spans the model: none may wait in a brick that never opens, nor vanish where small ones become splats."""
    source, out, count, small = os.path.join(folder, "in.ply"), os.path.join(folder, "out.stroll"), 20000, 30000
    dice = Random(5)
    with open(source, "w", encoding="ascii") as file:
        file.write(f"ply\nformat ascii 1.0\nelement vertex {3 * (count + small)}\nproperty float x\nproperty float y\nproperty float z\n"
                   f"element face {count + small}\nproperty list uchar int vertex_indices\nend_header\n")
        for t in range(count + small):
            middle, reach = ([0, 0, 0], 1) if t < count else ([dice.uniform(-1, 1) for _ in range(3)], 1e-3)
            for _ in range(3):
                file.write(" ".join(f"{middle[k] + reach * dice.uniform(-1, 1):.5f}" for k in range(3)) + "\n")
        file.writelines(f"3 {3 * t} {3 * t + 1} {3 * t + 2}\n" for t in range(count + small))
    build(source, out, "--structure", "samples")
    stats = os.path.join(folder, "stats.jsonl")
    for camera, most in (("eye 9 -7 6 target 0 0 0 up 0 0 1 fov 30", "1"), ("eye 90 -70 60 target 0 0 0 up 0 0 1 fov 30", "1")):
        must("render", out, "--camera", camera, "--error", most, "--backend", "null", "--stats", stats, "--quiet")
        frame = json.loads(read(stats))
        assert frame["triangles"] >= count and frame["missing_nodes"] == 0, frame


def any_order_of_the_input_gives_the_same_triangles(folder):
    source, _, _ = plant(folder)
    shuffled, out = os.path.join(folder, "shuffled.ply"), os.path.join(folder, "shuffled.stroll")
    must("scene", "plant", "--triangles", TRIANGLES, "--shuffle", "-o", shuffled, "--quiet")
    build(shuffled, out, "--structure", "samples", "--jobs", str(Random(1).randint(1, 4)))
    assert json.loads(must("verify", out, "--json", "--against", source).output)["ok"]


run_tests(what_samples_cannot_do_is_refused, backs_are_left_out_on_request, large_triangles_are_all_drawn_however_many_lie_in_a_cell, info_tells_what_it_is, verify_proves_it_and_not_against_another,
          extract_gives_what_is_above_a_front, as_the_error_goes_to_nothing_the_image_is_the_full_one,
          a_wireframe_shows_splats_as_they_are, other_errors_draw_fewer_triangles_and_splats, within_little_memory_it_coarsens,
          splats_are_errors_of_their_size, paths_along_the_surface_are_the_same_however_it_is_drawn, splats_of_confetti_are_as_bright_as_it, far_copies_of_confetti_are_as_bright_as_near_ones, any_order_of_the_input_gives_the_same_triangles)
