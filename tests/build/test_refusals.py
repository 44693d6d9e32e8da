#!/usr/bin/env python3
"""What no container can be made of is refused by its kind; what is built with something amiss is told and counted; a
lattice step that was asked for is kept or refused, never silently another."""
import json
import os

from building import assert_refused, build, must, run, run_tests

PLY = """ply
format ascii 1.0
element vertex {}
property double x
property double y
property double z
element face {}
property list uchar int vertex_indices
end_header
{}
"""
TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"


def write(folder, name, text):
    path = os.path.join(folder, name)
    with open(path, "w") as file:
        file.write(text)
    return path


def write_ply(folder, name, vertices, faces):
    return write(folder, name, PLY.format(len(vertices), len(faces), "\n".join([*vertices, *faces])))


def write_far(folder, name, distance):
    """Two triangles with legs of 1, so far apart."""
    far = distance + 1
    return write(folder, name, f"{TRIANGLE}v {distance!r} 0 0\nv {far!r} 0 0\nv {distance!r} 1 0\nf 4 5 6\n")


def refused(folder, source, *parts, more=()):
    before = sorted(os.listdir(folder))
    assert_refused(run("build", source, "-o", os.path.join(folder, "new.stroll"), *more), os.path.basename(source), *parts)
    assert sorted(os.listdir(folder)) == before


def empty(folder, sources, *parts):
    """Built, with one warning; the container is whole and can be drawn."""
    out = os.path.join(folder, "empty.stroll")
    done = must("build", *sources, "-o", out, "--json")
    result = json.loads(done.output)
    assert result["triangles_leaf"] == result["root_triangles"] == result["vertices"] == 0, result
    assert done.error.count("\n") == 1 and "no triangle: the model is empty" in done.error, done
    for part in (os.path.basename(sources[0]), *parts):
        assert part in done.error, (part, done)
    must("verify", out)
    info = json.loads(must("info", out, "--json").output)
    assert info["dropped"]["lines"] == result["dropped"]["lines"], (info, result)
    frames = os.path.join(folder, "frames.jsonl")
    must("render", out, "--backend", "null", "--path", "orbit", "--frames", "2", "--stats", frames)
    assert all(json.loads(line)["triangles"] == 0 for line in open(frames)), open(frames).read()
    os.remove(out)
    return result


def a_model_without_a_triangle_is_empty_and_told(folder):
    three = ["1 2 3", "2 2 3", "1 3 3"]
    points = write_ply(folder, "points.ply", three, [])
    empty(folder, [points], "found 3 vertices and")
    empty(folder, [write_ply(folder, "none.ply", [], [])], "found no triangle")
    empty(folder, [write_ply(folder, "two.ply", three, ["2 0 1", "1 0"])], "found 2 faces of fewer than three corners and")
    result = empty(folder, [write(folder, "kinds.obj", "v 0 0 0\nv 1 0 0\nl 1 2\nl 2 3\np 1\nf 1 2\n")],
                   "found 1 face of fewer than three corners, 2 lines, 1 point and")
    assert result["dropped"]["lines"] == 2 and result["dropped"]["points"] == 1, result
    empty(folder, [write(folder, "empty.stl", "solid a\nendsolid a\n")])
    empty(folder, [write(folder, "comment.obj", "# of a program\n")])
    empty(folder, [write(folder, "lines.obj", "v 0 0 0\nv 1 0 0\nl 1 2\n"), os.path.join(folder, "kinds.obj")], "lines.obj and 1 more: ")
    done = must("build", points, "-o", os.path.join(folder, "quiet.stroll"), "--quiet")
    assert done.error == "", done


def what_lost_all_its_triangles_or_is_a_model_by_name_alone_is_refused(folder):
    three = ["1 2 3", "2 2 3", "1 3 3"]
    refused(folder, write_ply(folder, "nan.ply", ["nan 0 0", *three], ["3 0 1 2"]),
            "found 1 triangle with a corner that is not finite")
    kinds = write(folder, "kinds.obj", "v 0 0 0\nv 1 0 0\nv 0 1 inf\nl 1 2\nl 2 3\np 1\nf 1 2 3\nf 1 2\n")
    refused(folder, kinds, "1 face of fewer than three corners, 1 triangle with a corner that is not finite, "
                           "2 lines, 1 point")
    refused(folder, write(folder, "page.obj", "<html>\n<body>\n"), "found no vertex and no face")
    thin = write(folder, "thin.obj", "v 0 0 0\nv 1 0 0\nf 1 2 1\nf 1 2 2\nl 1 2\nf 1 2\n")
    refused(folder, thin, "2 lose their area on the lattice", "also found 1 face of fewer than three corners, 1 line")


def extents_that_no_lattice_holds_are_refused_with_a_reason(folder):
    refused(folder, write_ply(folder, "same.ply", ["1 2 3"] * 3, ["3 0 1 2"] * 2), "all corners at one point, 1 2 3")
    refused(folder, write_ply(folder, "huge.ply", ["0 0 0", "1e300 0 0", "0 1e300 0"], ["3 0 1 2"]),
            "coordinates of at most 1e+150, found 1e+300")
    refused(folder, write_ply(folder, "wide.ply", ["0 0 0", "-1e308 0 0", "1e308 1 0"], ["3 0 1 2"]), "found 1e+308")
    refused(folder, write_ply(folder, "tiny.ply", ["0 0 0", "1e-145 0 0", "0 1e-145 0"], ["3 0 1 2"]),
            "an extent of at least 1e-140, found 1e-145")
    refused(folder, write_ply(folder, "away.ply", ["1e6 0 0", "1000000.0000000001 0 0", "1e6 1e-10 0"], ["3 0 1 2"]),
            "rounding of coordinates as large as 1e+06")


def step_of(path):
    return json.loads(must("info", path, "--json").output)["trees"][0]["step"]


def a_step_that_was_asked_for_is_kept_or_refused(folder):
    source, out = write_far(folder, "far.obj", 1e8), os.path.join(folder, "out.stroll")
    refused(folder, source, "--grid 0.01 ", "step of 0.0078125", "finer than the 0.125", "extent of 1e+08",
            "ask for 0.125 or more", more=["--grid", "0.01"])
    refused(folder, source, "finer than the 0.125", more=["--grid", "0.1249"])
    refused(folder, source, "2 lose their area on the lattice of step 512", "a smaller --grid", more=["--grid", "1000"])
    for asked, step in (("0.125", 0.125), ("0.3", 0.25), ("0.5", 0.5)):
        done = must("build", source, "-o", out, "--grid", asked, "--json")
        assert done.error == "" and json.loads(done.output)["warnings"]["coarse_lattices"] == 0, done
        assert step_of(out) == step


def a_step_coarser_than_short_edges_allow_is_told_and_counted(folder):
    out = os.path.join(folder, "out.stroll")
    done = must("build", write_far(folder, "near.obj", 1e5), "-o", out, "--json")
    assert done.error == "" and json.loads(done.output)["warnings"]["coarse_lattices"] == 0, done
    assert step_of(out) == 0.0625
    for distance, step in ((1e8, 0.125), (1e9, 1)):
        source = write_far(folder, "far.obj", distance)
        done = must("build", source, "-o", out, "--json")
        assert json.loads(done.output)["warnings"]["coarse_lattices"] == 1, done
        assert done.error.count("\n") == 1, done
        for part in ("warning", "far.obj", f"step {step:g} ", "short edge, 1,"):
            assert part in done.error, (part, done)
        assert step_of(out) == step
        assert "coarser than a sixteenth" in must("build", source, "-o", out).output
    refused(folder, write_far(folder, "beyond.obj", 1e10), "lattice of step 16, the finest that the extent allows")


def edges_too_short_for_a_float_still_choose_the_step(folder):
    """A row of triangles with legs of 1e-30 and 1e-29, 1e-24 long."""
    out = os.path.join(folder, "out.stroll")
    rows = "".join(f"v {i}e-26 0 0\nv {i}.001e-26 0 0\nv {i}e-26 1e-30 0\n" for i in range(100))
    faces = "".join(f"f {i} {i + 1} {i + 2}\n" for i in range(1, 301, 3))
    assert build(write(folder, "short.obj", rows + faces), out)["triangles_leaf"] == 100
    assert step_of(out) <= 1e-30 / 16


def missing_material_libraries_are_told_once_each_and_counted(folder):
    out = os.path.join(folder, "out.stroll")
    write(folder, "here.mtl", "newmtl green\nKd 0 1 0\n")
    good = write(folder, "good.obj", "mtllib here.mtl\n" + TRIANGLE)
    done = must("build", good, "-o", out, "--json")
    assert done.error == "" and json.loads(done.output)["warnings"]["missing_libraries"] == 0, done
    os.mkdir(os.path.join(folder, "folder.mtl"))
    bad = write(folder, "bad.obj", "mtllib nothere.mtl\nmtllib nothere.mtl\nmtllib here.mtl folder.mtl\n" + TRIANGLE)
    done = must("build", bad, "-o", out, "--json")
    assert json.loads(done.output)["warnings"]["missing_libraries"] == 2, done
    lines = done.error.splitlines()
    assert len(lines) == 2, done
    for line, name in zip(lines, ("nothere.mtl", "folder.mtl")):
        assert "warning" in line and "bad.obj" in line and name in line and "white" in line, done
    assert "missing: 2 material libraries" in must("build", bad, "-o", out).output
    quiet = must("build", bad, "-o", out, "--quiet")
    assert quiet.error == "" and quiet.output == "", quiet


def many_missing_libraries_do_not_flood_the_screen(folder):
    source = write(folder, "many.obj", "".join(f"mtllib {i}.mtl\n" for i in range(100)) + TRIANGLE)
    done = must("build", source, "-o", os.path.join(folder, "out.stroll"), "--json")
    assert json.loads(done.output)["warnings"]["missing_libraries"] == 100, done
    assert len(done.error.splitlines()) == 17 and "84 more material libraries" in done.error, done


def of_a_refused_model_only_the_refusal_is_told(folder):
    refused(folder, write(folder, "nan.obj", "mtllib nothere.mtl\nv nan 0 0\nf 1 1 1\n"), "found 1 triangle")


def formats_have_their_own_up(folder):
    out = os.path.join(folder, "out.stroll")
    sources = {"y": write(folder, "a.obj", TRIANGLE),
               "z": write_ply(folder, "a.ply", ["0 0 0", "1 0 0", "0 1 0"], ["3 0 1 2"])}
    for up, source in sources.items():
        build(source, out)
        assert json.loads(must("info", out, "--json").output)["up"] == up
        build(source, out, "--up", "x")
        assert json.loads(must("info", out, "--json").output)["up"] == "x"


run_tests(a_model_without_a_triangle_is_empty_and_told,
          what_lost_all_its_triangles_or_is_a_model_by_name_alone_is_refused, extents_that_no_lattice_holds_are_refused_with_a_reason,
          a_step_that_was_asked_for_is_kept_or_refused, a_step_coarser_than_short_edges_allow_is_told_and_counted,
          edges_too_short_for_a_float_still_choose_the_step,
          missing_material_libraries_are_told_once_each_and_counted, many_missing_libraries_do_not_flood_the_screen,
          of_a_refused_model_only_the_refusal_is_told, formats_have_their_own_up)
