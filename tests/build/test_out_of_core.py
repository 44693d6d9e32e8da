#!/usr/bin/env python3
"""A million triangles are built within 64 MiB, whoever measures: the operating system counts the memory, the
folder the disk."""
import json
import os
import struct
import sys
from random import Random

from building import MIB, check_result, must, run_tests, sanitizers, skip

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "bench"))
sys.dont_write_bytecode = True
from measure import DiskWatch

SCRATCH_A_TRIANGLE = 80


def build_within(sources, folder, memory, jobs):
    sources = [sources] if isinstance(sources, str) else sources
    output = os.path.join(folder, "out.stroll")
    with DiskWatch(output + ".tmp") as disk:
        done = must("build", *sources, "-o", output, "--json", "--memory", f"{memory}M", "--jobs", str(jobs))
    result = json.loads(done.output)
    check_result(result)
    triangles = result["triangles_in"]
    print(f"{triangles} triangles, --memory {memory}M --jobs {jobs}: peak {done.peak_bytes / MIB:.1f} MiB, said "
          f"{result['peak_rss_bytes'] / MIB:.1f}; scratch {result['scratch_bytes'] / triangles:.1f} bytes a triangle, "
          f"seen {disk.most_bytes / triangles:.1f}; {done.seconds:.1f} s", flush=True)
    assert done.peak_bytes < memory * MIB, f"peak {done.peak_bytes} bytes"
    assert abs(done.peak_bytes - result["peak_rss_bytes"]) < 8 * MIB
    assert result["scratch_bytes"] <= SCRATCH_A_TRIANGLE * triangles
    assert disk.most_bytes <= SCRATCH_A_TRIANGLE * triangles, f"{disk.most_bytes / triangles:.1f} bytes of disk a triangle"
    assert disk.most_bytes > 10 * triangles, "the folder was not where it was watched"
    assert sorted(os.listdir(folder)) == sorted([*map(os.path.basename, sources), "out.stroll"])
    return result


def a_million_triangles_fit_into_64_mib(folder):
    source = os.path.join(folder, "in.ply")
    must("scene", "isosurface", "--triangles", "1M", "-o", source, "--quiet")
    result = build_within(source, folder, 64, 2)
    assert result["triangles_in"] > 950_000


def many_threads_share_the_same_memory(folder):
    source = os.path.join(folder, "in.ply")
    must("scene", "isosurface", "--triangles", "250K", "-o", source, "--quiet")
    build_within(source, folder, 128, 8)


def the_least_memory_is_enough(folder):
    source = os.path.join(folder, "in.ply")
    must("scene", "isosurface", "--triangles", "500K", "-o", source, "--quiet", "--no-normals")
    build_within(source, folder, 64, 1)


def many_small_parts_fit(folder):
    source = os.path.join(folder, "in.ply")
    must("scene", "boxes", "--triangles", "240K", "-o", source, "--quiet")
    build_within(source, folder, 128, 2)


def many_shaded_parts_fit(folder):
    """A plant's groups hold more points and wedges than a surface's."""
    source = os.path.join(folder, "in.ply")
    must("scene", "plant", "--triangles", "200K", "-o", source, "--quiet")
    build_within(source, folder, 64, 4)
    os.remove(os.path.join(folder, "out.stroll"))
    build_within(source, folder, 100, 8)


def in_any_order_it_fits(folder):
    source = os.path.join(folder, "in.ply")
    must("scene", "isosurface", "--triangles", "300K", "-o", source, "--quiet", "--shuffle")
    build_within(source, folder, 64, 2)


def many_files_share_the_same_memory(folder):
    """Readers of 24 tiles would take twice the memory, were they all at work at once."""
    tiles = [os.path.join(folder, f"tile{number}.ply") for number in range(24)]
    for number, tile in enumerate(tiles):
        must("scene", "isosurface", "--triangles", "12K", "--seed", str(number + 1), "-o", tile, "--quiet")
    build_within(tiles, folder, 64, 2)


def many_named_parts_fit(folder):
    source = os.path.join(folder, "in.obj")
    with open(source, "w", encoding="ascii") as file:
        for part in range(40_000):
            x, y = part % 200, part // 200
            file.write(f"o SYSTEM-{part // 1000:03d}/LINE-{part:06d}\nv {x} {y} 0\nv {x + .6} {y} 0\nv {x} {y + .6} 0\n"
                       f"v {x} {y} .5\nf -4 -2 -3\nf -4 -3 -1\nf -3 -2 -1\nf -2 -4 -1\n")
    result = build_within(source, folder, 128, 2)
    assert result["parts"] == 40_000


def write_soup_ply(path, count, size):
    """Triangles anywhere in a cube; no two have a vertex in common."""
    random = Random(1)
    head = (f"ply\nformat binary_little_endian 1.0\nelement vertex {3 * count}\nproperty float x\nproperty float y\n"
            f"property float z\nelement face {count}\nproperty list uchar int vertex_indices\nend_header\n")
    with open(path, "wb") as file:
        file.write(head.encode())
        for _ in range(count):
            centre = [random.random() for _ in range(3)]
            corners = [at + random.uniform(-size, size) for _ in range(3) for at in centre]
            file.write(struct.pack("<9f", *corners))
        for at in range(0, 3 * count, 3):
            file.write(struct.pack("<B3i", 3, at, at + 1, at + 2))


def without_shared_vertices_it_still_fits(folder):
    source = os.path.join(folder, "in.ply")
    for size in (0.001, 0.5):
        write_soup_ply(source, 50_000, size)
        build_within(source, folder, 128, 2)
        os.remove(os.path.join(folder, "out.stroll"))


if sanitizers():
    skip("sanitizers take memory of their own")
run_tests(a_million_triangles_fit_into_64_mib, many_threads_share_the_same_memory, the_least_memory_is_enough,
          in_any_order_it_fits, many_files_share_the_same_memory, many_small_parts_fit, many_shaded_parts_fit, many_named_parts_fit,
          without_shared_vertices_it_still_fits)
