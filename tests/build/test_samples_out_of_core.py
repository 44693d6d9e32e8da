#!/usr/bin/env python3
"""Sample trees are built within 64 MiB whatever the model, whoever measures: the operating system counts the memory. What little memory
gives holds the same triangles as what ample memory gives, and the same bytes for any number of threads."""
import hashlib
import json
import os
import struct
import sys
from random import Random

from building import MIB, check_result, must, run_tests, sanitizers, skip

SCRATCH_A_TRIANGLE = 100


def digest(path):
    with open(path, "rb") as file:
        return hashlib.sha256(file.read()).hexdigest()


def build_within(source, out, memory, jobs):
    done = must("build", source, "-o", out, "--json", "--structure", "samples", "--memory", f"{memory}M", "--jobs", str(jobs))
    result = json.loads(done.output)
    check_result(result)
    print(f"{result['triangles_in']} triangles, --memory {memory}M --jobs {jobs}: peak {done.peak_bytes / MIB:.1f} MiB, scratch "
          f"{result['scratch_bytes'] / result['triangles_in']:.1f} bytes a triangle; {done.seconds:.1f} s", flush=True)
    assert done.peak_bytes < memory * MIB, f"peak {done.peak_bytes} bytes"
    assert result["scratch_bytes"] <= SCRATCH_A_TRIANGLE * result["triangles_in"]
    assert sorted(os.listdir(os.path.dirname(out))) == sorted([os.path.basename(source), os.path.basename(out)])
    return result


def verify(out, source):
    done = must("verify", out, "--json", "--against", source, "--cuts", "4")
    assert json.loads(done.output)["ok"], done
    os.remove(out)


def a_surface_of_many_pieces(folder):
    source, out = os.path.join(folder, "in.ply"), os.path.join(folder, "out.stroll")
    must("scene", "isosurface", "--triangles", "700K", "-o", source, "--quiet")
    build_within(source, out, 64, 1)
    first = digest(out)
    for jobs in (2, 8):
        build_within(source, out, 64, jobs)
        assert digest(out) == first, jobs
    verify(out, source)
    build_within(source, out, 1024, 2)
    verify(out, source)


def write_triangles(path, count, triangles):
    """Nine floats each; no two have a vertex in common."""
    head = (f"ply\nformat binary_little_endian 1.0\nelement vertex {3 * count}\nproperty float x\nproperty float y\n"
            f"property float z\nelement face {count}\nproperty list uchar int vertex_indices\nend_header\n")
    with open(path, "wb") as file:
        file.write(head.encode())
        file.writelines(triangles)
        file.writelines(struct.pack("<B3i", 3, at, at + 1, at + 2) for at in range(0, 3 * count, 3))


def round_place(random, centre, size):
    return struct.pack("<9f", *(at + random.uniform(-size, size) for _ in range(3) for at in centre))


def write_soup(path, count, size_of):
    """Triangles anywhere in a cube."""
    random = Random(1)
    write_triangles(path, count, (round_place(random, [random.random() for _ in range(3)], size_of(number)) for number in range(count)))


def what_no_piece_holds_is_held_in_memory_and_bounded(folder):
    source, out = os.path.join(folder, "in.ply"), os.path.join(folder, "out.stroll")
    for size_of in (lambda number: 0.5, lambda number: 0.2 if number % 5 == 0 else 0.002):
        write_soup(source, 100_000, size_of)
        build_within(source, out, 64, 2)
        verify(out, source)


def write_spot(path, kinds):
    """600,000 triangles of these kinds, whose centroids are one place of the lattice, and of each 16 the first anywhere in a cube."""
    random, count = Random(2), 600_000
    write_triangles(path, count, (kinds[number % len(kinds)] if number % 16 else round_place(random, [random.random() for _ in range(3)], 0.002)
                                  for number in range(count)))


def very_many_at_one_spot_are_divided_by_number(folder):
    """The curve cannot tell them apart: equal ones, in the lowest corner; small ones in one cell; large ones round it. One of each sixteen
    is all that a sample of every 16th sees."""
    source, out, random = os.path.join(folder, "in.ply"), os.path.join(folder, "out.stroll"), Random(4)
    small = [round_place(random, (0.3, 0.6, 0.2), 2e-6) for _ in range(1000)]
    large = []
    for _ in range(1000):
        a, b = ([random.uniform(-0.1, 0.1) for _ in range(3)] for _ in range(2))
        large.append(struct.pack("<9f", *(0.5 + x for x in a), *(0.5 + x for x in b), *(0.5 - x - y for x, y in zip(a, b))))
    corner = struct.pack("<9f", -1, -1, -1, -1 + 1e-4, -1, -1, -1, -1 + 1e-4, -1)
    for kinds in ([corner], small, large):
        write_spot(source, kinds)
        build_within(source, out, 64, 1)
        first = digest(out)
        build_within(source, out, 64, 3)
        assert digest(out) == first
        verify(out, source)


if sanitizers():
    skip("sanitizers take memory of their own")
run_tests(a_surface_of_many_pieces, what_no_piece_holds_is_held_in_memory_and_bounded, very_many_at_one_spot_are_divided_by_number)
