#!/usr/bin/env python3
"""Reading glTF takes time and scratch in proportion to its triangles, whatever its accessors and instances count."""
import json
import random
import resource
import time

import gltf_writer as w
import image_writer as image
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


def painted(points, places, order, stand_at=None, mode=4):
    """A glTF under an image, placed twice. stand_at: the vertices' indices, all others are zero; None: one after the other."""
    model = w.Model()

    def accessor(rows):
        if stand_at is None:
            return model.accessor(rows, w.FLOAT)
        return model.add("accessors", {"componentType": w.FLOAT, "type": w.TYPES[len(rows[0])], "count": MANY, "sparse": {
            "count": len(rows),
            "indices": {"bufferView": model.view(w.pack([(at,) for at in stand_at], w.U32)), "componentType": w.U32},
            "values": {"bufferView": model.view(w.pack(rows, w.FLOAT))}}})
    primitive = {"attributes": {"POSITION": accessor(points), "TEXCOORD_0": accessor(places)}, "mode": mode,
                 "material": model.add("materials", {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}})}
    if order:
        primitive["indices"] = model.accessor([stand_at[i] if stand_at else i for i in order], w.U32)
    mesh = model.mesh(primitive)
    model.add("textures", {"source": 0})
    model.add("images", {"uri": "image.png"})
    model.scene(model.node(mesh=mesh), model.node(mesh=mesh, translation=[0, 0, 9]))
    return model


def shown(model, path):
    model.glb(path)
    result = read(path)
    assert "error" not in result and result["missing_images"] == 0, result
    return [t["colours"] for t in result["triangles"]], [t["texcoords"] for t in result["triangles"]]


def under_an_image_too_only_the_vertices_in_use_are_read(folder):
    """Small triangles and a large one, so that what a vertex stands for differs: from a range that begins late the colours
    are those of vertices that begin at 0."""
    dice = random.Random(5)
    w.save(f"{folder}/image.png", image.png([[tuple(dice.randrange(256) for _ in range(3)) for _ in range(64)]
                                             for _ in range(64)]))
    points = [(dice.random(), dice.random(), dice.random()) for _ in range(7)]
    places = [(0.1, 0.1), (0.12, 0.1), (0.1, 0.13), (0.9, 0.2), (0.95, 0.8), (0.3, 0.7), (0.31, 0.72)]
    for mode, order in ((4, [0, 1, 2, 2, 1, 3, 4, 5, 6, 6, 5, 0]), (5, [6, 0, 1, 2, 4, 5]), (6, [2, 0, 1, 3, 4, 6])):
        plain = shown(painted(points, places, order, mode=mode), f"{folder}/plain.glb")
        late = painted(points, places, order, [4000000000 + 9 * i for i in range(7)], mode)
        with_little_scratch(lambda: check_same(plain, shown(late, f"{folder}/late.glb")))
        assert len({colour for colours in plain[0] for colour in colours}) > 4, plain


def check_same(wanted, got):
    assert got == wanted, f"found {got}, expected {wanted}"


def far_apart_under_an_image_all_corners_have_the_mean(folder):
    """As they have where each triangle has corners of its own."""
    dice = random.Random(6)
    w.save(f"{folder}/image.png", image.png([[tuple(dice.randrange(256) for _ in range(3)) for _ in range(64)]
                                             for _ in range(64)]))
    places = [(0.1, 0.1), (0.2, 0.1), (0.1, 0.4), (0.9, 0.2), (0.95, 0.8)]
    for mode, order in ((4, [0, 1, 2, 2, 3, 4]), (5, [0, 1, 2, 3, 4]), (6, [2, 0, 1, 3, 4])):
        own = painted([FAR[i] for i in order], [places[i] for i in order], None, mode=mode)
        wanted = shown(own, f"{folder}/own.glb")
        far = painted(FAR, places, order, PLACES, mode)
        with_little_scratch(lambda: check_same(wanted, shown(far, f"{folder}/far.glb")))
        assert len({colour for colours in wanted[0] for colour in colours}) > 3, wanted


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
           primitives_that_share_their_vertices_load_their_own, under_an_image_too_only_the_vertices_in_use_are_read,
           far_apart_under_an_image_all_corners_have_the_mean, instances_without_triangles_are_passed_over,
           text_in_utf16_may_hold_its_buffers])
