#!/usr/bin/env python3
"""Every nasty PLY, STL, OBJ and glTF, and where the importer is there every file of a foreign format, is built, with what was
dropped counted, or refused with one sentence: soon, in little memory, without a signal, and with nothing left behind."""
import json
import os
import sys
import tempfile

from building import MIB, STROLL, data_folder, models, run, sanitizers, skip, unpack

MOST_SECONDS = 20 * (6 if sanitizers() else 1)
MOST_BYTES = 300 * MIB
OURS = (".ply", ".stl", ".obj", ".gltf", ".glb")
FOREIGN = (".3ds", ".3mf", ".ase", ".dae", ".dxf", ".lwo", ".md5mesh", ".off", ".raw", ".smd", ".step", ".x", ".zae")


def problem_of(path, folder):
    """What is wrong with the way a file was treated; None = nothing. Also whether it was built."""
    out = os.path.join(folder, "out.stroll")
    try:
        done = run("build", path, "-o", out, "--json", "--memory", "128M", "--jobs", "2", timeout=MOST_SECONDS)
    except AssertionError as error:
        return str(error), False
    left = os.listdir(folder)
    if os.path.exists(out):
        os.remove(out)
    if not sanitizers() and done.peak_bytes >= MOST_BYTES:
        return f"too much memory: {done}", False
    if done.code == 0:
        result = json.loads(done.output)
        dropped = result["dropped"]["nonfinite"] + result["dropped"]["degenerate"]
        if result["triangles_in"] != result["triangles_leaf"] + dropped or not 0 < result["root_triangles"] <= 16384:
            return f"the counts do not add up: {done}", True
        return (None if left == ["out.stroll"] else f"left {left}: {done}"), True
    lines = done.error.strip("\n").split("\n")
    if done.code != 1 or len(lines) != 1 or len(lines[0]) < 20:
        return f"no clean refusal: {done}", False
    if os.path.basename(path) not in lines[0]:
        return f"the sentence does not name the file: {done}", False
    return (None if left == [] else f"left {left}: {done}"), False


def has_importer():
    found = os.path.exists(os.path.join(os.path.dirname(STROLL), "stroll-import"))
    if not found:
        print("no foreign formats: stroll-import was not built")
    return found


def main():
    archive = os.path.join(data_folder(), "nasty.tar.zst")
    if not os.path.exists(archive):
        skip(f"there is no {archive}")
    problems, built, refused = [], 0, 0
    with tempfile.TemporaryDirectory() as archive_folder, tempfile.TemporaryDirectory() as work:
        unpack(archive, archive_folder)
        paths = models(archive_folder, OURS + (FOREIGN if has_importer() else ()))
        assert len(paths) > 100, f"only {len(paths)} files in {archive}"
        for path in paths:
            problem, was_built = problem_of(path, work)
            built, refused = built + was_built, refused + (not was_built)
            if problem:
                problems.append(f"{os.path.relpath(path, archive_folder)}: {problem}")
    print("\n".join(problems))
    print(f"{built} built, {refused} refused, {len(problems)} wrong")
    return 1 if problems or built < 50 else 0


sys.exit(main())
