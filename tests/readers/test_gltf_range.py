#!/usr/bin/env python3
"""Reading glTF takes time and scratch in proportion to its triangles, whatever its accessors and instances count."""
import json
import resource
import time

import gltf_writer as w
from gltf_reading import expect, read, refuse, run_tests

MANY = 4294967295  # elements of an accessor without a view take no byte of the file
FAR = [(0, 0, 0), (4, 0, 1), (4, 2, 0), (1, 2, 3), (0, 5, 2)]
PLACES = [7, 9, 4000000000, 4100000000, 4294967294]


def far_apart(order, mode=4):
    """A few of many vertices are not zero, and used."""
    model = w.Model()
    position = model.add("accessors", {"componentType": w.FLOAT, "type": "VEC3", "count": MANY, "sparse": {
        "count": len(FAR),
        "indices": {"bufferView": model.view(w.pack([(at,) for at in PLACES], w.U32)), "componentType": w.U32},
        "values": {"bufferView": model.view(w.pack(FAR, w.FLOAT))}}})
    mesh = model.mesh({"attributes": {"POSITION": position}, "mode": mode,
                       "indices": model.accessor([PLACES[i] for i in order], w.U32)})
    model.scene(model.node(mesh=mesh), model.node(mesh=mesh, translation=[0, 0, 9]))
    return model


def with_little_scratch(test):
    """No file may grow beyond 16 MiB meanwhile."""
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (16 << 20, limits[1]))
    try:
        test()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)


def vertices_that_nothing_uses_are_not_read(folder):
    for mode, order in ((4, [0, 1, 2, 2, 3, 4]), (5, [0, 1, 2, 3, 4]), (6, [2, 0, 1, 3, 4])):
        far_apart(order, mode).glb(f"{folder}/far.glb")
        wanted = [triangle for up in (0, 9)
                  for triangle in w.triangles(FAR, order, w.compose([0, 0, up]), mode=mode)]
        with_little_scratch(lambda: expect(f"{folder}/far.glb", wanted))


def an_index_beyond_far_vertices_is_refused_with_its_triangle(folder):
    cases = ((4, [7, 9, 4000000000, 7, 9, MANY], 1), (5, [7, 9, 4000000000, 11, MANY], 2),
             (6, [7, 9, 4000000000, MANY], 1), (6, [MANY, 9, 4000000000, 7], 0))
    for mode, order, triangle in cases:
        model = far_apart([0], mode)
        model.json["meshes"][0]["primitives"][0]["indices"] = model.accessor(order, w.U32)
        model.glb(f"{folder}/beyond.glb")
        with_little_scratch(lambda: refuse(f"{folder}/beyond.glb", f"expected indices below {MANY}",
                                           f"found {MANY} in triangle {triangle}"))


def primitives_that_share_their_vertices_load_their_own(folder):
    """Exporters that give all primitives the vertices of the whole model are many."""
    count = 200000
    points = [(i % 100, i // 100, i % 7) for i in range(count)]
    model = w.Model()
    position = model.accessor(points, w.FLOAT)
    wanted, nodes = [], []
    for number in range(8000):
        first = number * 24
        order = [first, first + 1, first + 100, first + 2, first + 3, first + 102]
        index = model.accessor(order, w.U32)
        nodes.append(model.node(mesh=model.mesh({"attributes": {"POSITION": position}, "indices": index})))
        wanted += w.triangles(points, order)
    model.scene(*nodes)
    model.glb(f"{folder}/shared.glb")
    start = time.monotonic()
    result = read(f"{folder}/shared.glb", 64 << 20)
    seconds = time.monotonic() - start
    assert (result["count"], result["hash"]) == (len(wanted), w.position_hash(wanted)), result["count"]
    assert seconds < 10, f"{seconds} s for {len(wanted)} triangles"  # each loads all: more than a minute


def instances_without_triangles_are_passed_over(folder):
    model = w.Model()
    instancing = {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": model.add(
        "accessors", {"componentType": w.FLOAT, "type": "VEC3", "count": MANY})}}}
    model.plain(FAR[:2], node={"extensions": instancing})
    model.json["scenes"][0]["nodes"].append(model.node(mesh=model.mesh(
        {"attributes": {"POSITION": model.accessor(FAR[:3], w.FLOAT)}})))
    model.glb(f"{folder}/none.glb")
    expect(f"{folder}/none.glb", w.triangles(FAR[:3]), degenerate=MANY)


def text_in_utf16_may_hold_its_buffers(folder):
    model = w.Model()
    model.plain(FAR, [0, 1, 2, 2, 3, 4])
    model.gltf(f"{folder}/plain.gltf")
    with open(f"{folder}/plain.gltf", encoding="utf-8") as file:
        text = file.read()
    for encoding, mark in (("utf-16-le", b"\xff\xfe"), ("utf-16-be", b"\xfe\xff")):
        w.save(f"{folder}/wide.gltf", mark + text.encode(encoding))
        expect(f"{folder}/wide.gltf", w.triangles(FAR, [0, 1, 2, 2, 3, 4]))
    assert json.loads(text)["buffers"][0]["uri"].startswith("data:")


run_tests([vertices_that_nothing_uses_are_not_read, an_index_beyond_far_vertices_is_refused_with_its_triangle,
           primitives_that_share_their_vertices_load_their_own, instances_without_triangles_are_passed_over,
           text_in_utf16_may_hold_its_buffers])
