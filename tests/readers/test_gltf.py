#!/usr/bin/env python3
"""The glTF reader, feature by feature: each has a fixture whose triangles a writer of its own knows."""
import json
import math
import os
import struct

import gltf_writer as w
import image_writer as image
from gltf_reading import LEAST, expect, near, pack, read, run_tests

QUAD = [(0, 0, 0), (1, 0, 0), (1, 1, 0.5), (0, 1, 0.25)]
QUAD_INDICES = [0, 1, 2, 0, 2, 3]
HALF = math.sqrt(0.5)


def grid(size):
    """A bumpy sheet: positions and indices."""
    points = [(x / 8, y / 8, (x * 7 + y * 3) % 5 / 16) for y in range(size) for x in range(size)]
    faces = [y * size + x + corner for y in range(size - 1) for x in range(size - 1)
             for corner in (0, 1, size, 1, size + 1, size)]
    return points, faces


def indices_of_all_types_and_none_give_the_same_quad(folder):
    for component in (w.U8, w.U16, w.U32):
        path = f"{folder}/quad{component}.glb"
        model = w.Model()
        model.plain(QUAD, QUAD_INDICES, component=component)
        model.glb(path)
        expect(path, w.triangles(QUAD, QUAD_INDICES), format="glb", unit="m", up=1, exact=True, vertices=4)
    model = w.Model()
    model.plain([QUAD[i] for i in QUAD_INDICES])
    model.glb(f"{folder}/list.glb")
    expect(f"{folder}/list.glb", w.triangles(QUAD, QUAD_INDICES))


def strips_and_fans_turn_as_the_specification_says(folder):
    points, _ = grid(5)
    order = [4, 3, 9, 8, 14, 13, 19, 18, 24]
    for mode in (5, 6):
        for indexed in (False, True):
            path = f"{folder}/mode{mode}{indexed}.glb"
            model = w.Model()
            model.plain(points, order if indexed else None, mode=mode)
            model.glb(path)
            expect(path, w.triangles(points, order if indexed else None, mode=mode))


def long_strips_and_fans_are_read_in_runs(folder):
    points, _ = grid(60)
    for mode in (5, 6):
        for order in (None, [i * 37 % len(points) for i in range(9000)]):
            path = f"{folder}/long{mode}.glb"
            model = w.Model()
            model.plain(points, order, mode=mode)
            model.glb(path)
            expect(path, w.triangles(points, order, mode=mode))


def nodes_are_placed_by_all_above_them(folder):
    outer = {"translation": [10, -2, 4], "rotation": [0, 0, HALF, HALF], "scale": [2, 2, 0.5]}
    inner = [0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1, 0, 3, 4, 5, 1]
    model = w.Model()
    mesh = model.mesh({"attributes": {"POSITION": model.accessor(QUAD, w.FLOAT)}})
    child = model.node(mesh=mesh, matrix=inner)
    model.scene(model.node(children=[child], **outer))
    model.json["meshes"][0]["primitives"][0]["indices"] = model.accessor(QUAD_INDICES, w.U16)
    model.glb(f"{folder}/nodes.glb")
    matrix = w.multiply(w.compose(outer["translation"], outer["rotation"], outer["scale"]),
                        [[inner[4 * c + r] for c in range(4)] for r in range(3)])
    expect(f"{folder}/nodes.glb", w.triangles(QUAD, QUAD_INDICES, matrix))


def a_mirror_turns_the_winding(folder):
    for scale in ([-1, 1, 1], [-2, -2, -2], [-1, -1, 1]):
        model = w.Model()
        model.plain(QUAD, QUAD_INDICES, node={"scale": scale})
        model.glb(f"{folder}/mirror.glb")
        expect(f"{folder}/mirror.glb", w.triangles(QUAD, QUAD_INDICES, w.compose(scale=scale)))


def normals_go_by_the_inverse_transpose(folder):
    slope = [(0, 0, 0), (1, 0, 1), (0, 1, 0)]
    normal = (-HALF, 0, HALF)
    for scale in ([4, 1, 1], [-4, 1, 1], [0.001, 0.001, 0.002]):
        model = w.Model()
        model.plain(slope, node={"scale": scale})
        model.json["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = model.accessor([normal] * 3, w.FLOAT)
        model.glb(f"{folder}/normals.glb")
        matrix = w.compose(scale=scale)
        result = expect(f"{folder}/normals.glb", w.triangles(slope, None, matrix))
        (a, b, c), = w.triangles(slope, None, matrix)
        u, v = [y - x for x, y in zip(a, b)], [y - x for x, y in zip(a, c)]
        cross = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]
        length = math.sqrt(sum(x * x for x in cross))
        triangle = result["triangles"][0]
        assert triangle["flags"] == 1 and near(triangle["normals"], [x / length for x in cross] * 3, 1e-6), triangle


def meshes_are_used_again_and_again(folder):
    places = [([i, 2 * i, 0], [0, HALF, 0, HALF] if i % 2 else [0, 0, 0, 1]) for i in range(7)]
    model = w.Model()
    mesh = model.mesh({"attributes": {"POSITION": model.accessor(QUAD, w.FLOAT)}})
    model.scene(*[model.node(mesh=mesh, translation=t, rotation=r) for t, r in places])
    model.glb(f"{folder}/again.glb")
    wanted = [t for place in places for t in w.triangles(QUAD, None, w.compose(*place))]
    result = expect(f"{folder}/again.glb", wanted, degenerate=7)  # of four corners one is left
    assert [t["part"] for t in result["triangles"]] == list(range(7))


def points_and_lines_are_counted_and_primitives_without_positions_passed_over(folder):
    model = w.Model()
    position = model.accessor(QUAD, w.FLOAT)
    index = model.accessor([0, 1, 2, 3, 0, 2], w.U16)
    attributes = {"POSITION": position}
    mesh = model.mesh({"attributes": attributes, "mode": 0}, {"attributes": attributes, "mode": 1, "indices": index},
                      {"attributes": attributes, "mode": 2}, {"attributes": attributes, "mode": 3},
                      {"attributes": {"NORMAL": position}}, {"attributes": {}},
                      {"attributes": attributes, "indices": index})
    model.scene(model.node(mesh=mesh), model.node(mesh=mesh, translation=[5, 0, 0]))
    model.glb(f"{folder}/drops.glb")
    wanted = [t for x in (0, 5) for t in w.triangles(QUAD, [0, 1, 2, 3, 0, 2], w.compose([x, 0, 0]))]
    expect(f"{folder}/drops.glb", wanted, points=2 * 4, lines=2 * (3 + 3 + 4), degenerate=0)


def corners_that_are_not_finite_are_counted(folder):
    model = w.Model()
    model.plain([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, float("nan")), (1, 0, 0), (0, 1, 0)])
    model.glb(f"{folder}/nan.glb")
    expect(f"{folder}/nan.glb", w.triangles(QUAD[:2] + [(0, 1, 0)]), nonfinite=1)


def quantised_positions_are_normalized_where_the_accessor_says_so(folder):
    cases = [(w.U16, True, 65535), (w.I16, True, 32767), (w.U8, True, 255), (w.I8, True, 127),
             (w.I16, False, 1), (w.U8, False, 1)]
    for component, normalized, most in cases:
        rows = [(0, 0, 0), (100, 3, 0), (120, 90, 7), (1, 2, 3)]
        if component in (w.I8, w.I16):
            rows = [(-x, y, z) for x, y, z in rows]
        model = w.Model()
        stride = 8 if component in (w.U16, w.I16) else 4
        position = model.accessor(rows, component, stride=stride, normalized=normalized)
        mesh = model.mesh({"attributes": {"POSITION": position}, "indices": model.accessor(QUAD_INDICES, w.U8)})
        model.scene(model.node(mesh=mesh, scale=[most] * 3))
        model.json["extensionsRequired"] = model.json["extensionsUsed"] = ["KHR_mesh_quantization"]
        model.glb(f"{folder}/quantised.glb")
        expect(f"{folder}/quantised.glb", w.triangles(rows, QUAD_INDICES))


def interleaved_attributes_are_read_by_their_stride(folder):
    points, faces = grid(40)
    normals = [(0, 0, 1)] * len(points)
    data = b"".join(struct.pack("<3f3f4B", *p, *n, i & 255, 0, 0, 255) for i, (p, n) in enumerate(zip(points, normals)))
    model = w.Model()
    view = model.view(data, stride=28)
    shared = {"bufferView": view, "count": len(points), "componentType": w.FLOAT, "type": "VEC3"}
    attributes = {"POSITION": model.add("accessors", {**shared}),
                  "NORMAL": model.add("accessors", {**shared, "byteOffset": 12}),
                  "COLOR_0": model.add("accessors", {**shared, "byteOffset": 24, "componentType": w.U8, "type": "VEC4",
                                                     "normalized": True})}
    mesh = model.mesh({"attributes": attributes, "indices": model.accessor(faces, w.U16)})
    model.scene(model.node(mesh=mesh))
    model.glb(f"{folder}/interleaved.glb")
    result = expect(f"{folder}/interleaved.glb", w.triangles(points, faces))
    for triangle, face in zip(result["triangles"], zip(*[iter(faces)] * 3)):
        assert triangle["flags"] == 3
        assert triangle["colours"] == [w.rgba((i & 255) / 255, 0, 0) for i in face], triangle
        assert triangle["normals"] == [0, 0, 1] * 3


def sparse_elements_replace_those_of_the_view_or_zeros(folder):
    points, faces = grid(70)
    changed = {i: (i / 16, 9, -3) for i in range(5, len(points), 3)}
    for base in (True, False):
        model = w.Model()
        position = (model.accessor(points, w.FLOAT) if base else
                    model.add("accessors", {"componentType": w.FLOAT, "type": "VEC3", "count": len(points)}))
        model.json["accessors"][position]["sparse"] = {
            "count": len(changed),
            "indices": {"bufferView": model.view(w.pack([(i,) for i in changed], w.U16)), "componentType": w.U16},
            "values": {"bufferView": model.view(w.pack(changed.values(), w.FLOAT))}}
        mesh = model.mesh({"attributes": {"POSITION": position}, "indices": model.accessor(faces, w.U16)})
        model.scene(model.node(mesh=mesh))
        model.glb(f"{folder}/sparse.glb")
        start = points if base else [(0, 0, 0)] * len(points)
        expect(f"{folder}/sparse.glb", w.triangles([changed.get(i, p) for i, p in enumerate(start)], faces))


def sparse_indices_replace_indices(folder):
    model = w.Model()
    item = model.plain(QUAD, [0, 0, 0, 0, 2, 3])
    model.json["accessors"][item["indices"]]["sparse"] = {
        "count": 2, "indices": {"bufferView": model.view(bytes([1, 2])), "componentType": w.U8},
        "values": {"bufferView": model.view(struct.pack("<2H", 1, 2))}}
    model.glb(f"{folder}/sparse_indices.glb")
    expect(f"{folder}/sparse_indices.glb", w.triangles(QUAD, QUAD_INDICES))


def buffers_lie_beside_the_model_or_in_its_text(folder):
    points, faces = grid(30)

    def make():
        model = w.Model()
        model.buffers.append(bytearray(b"pad!"))
        position, index = model.accessor(points, w.FLOAT, buffer=0), model.accessor(faces, w.U16, buffer=1)
        model.scene(model.node(mesh=model.mesh({"attributes": {"POSITION": position}, "indices": index})))
        return model

    wanted = w.triangles(points, faces)
    names = [("points%20%C3%A9.bin", "points é.bin"), ("sub/./faces.bin", "sub/faces.bin")]
    make().gltf(f"{folder}/beside.gltf", names)
    result = expect(f"{folder}/beside.gltf", wanted, format="gltf")
    assert result["bytes"] > os.path.getsize(f"{folder}/beside.gltf") + 12 * len(points)
    make().gltf(f"{folder}/literal.gltf", [("100%25.bin", "100%25.bin"), ("a.bin", "a.bin")])
    expect(f"{folder}/literal.gltf", wanted)
    make().gltf(f"{folder}/text.gltf", indent=2, bom=True)
    expect(f"{folder}/text.gltf", wanted)
    text = open(f"{folder}/text.gltf", "rb").read().replace(b"/", b"\\/")
    w.save(f"{folder}/escaped.gltf", text)
    expect(f"{folder}/escaped.gltf", wanted)
    text = open(f"{folder}/text.gltf", "rb").read()
    head, data = text[:text.index(b"base64,")], text[text.index(b"base64,"):]
    assert b"+" in data and b"/" in data and b"=" in data
    for plus, slash, end in ((rb"\u002B", rb"\/", rb"\u003D"), (rb"\u002b", rb"\u002F", rb"\u003d")):
        w.save(f"{folder}/escaped.gltf", head + data.replace(b"+", plus).replace(b"/", slash).replace(b"=", end))
        expect(f"{folder}/escaped.gltf", wanted)


def a_large_buffer_in_the_text_goes_to_scratch(folder):
    points, faces = grid(300)
    model = w.Model()
    model.plain(points, faces, component=w.U32)
    model.gltf(f"{folder}/large.gltf")
    small = read(f"{folder}/large.gltf", LEAST)
    assert small == read(f"{folder}/large.gltf", 256 << 20), "the budget changed the triangles"
    assert small["count"] == len(faces) // 3 and small["hash"] == w.position_hash(w.triangles(points, faces))
    assert "no scratch folder" in read(f"{folder}/large.gltf", LEAST, scratch=False)["error"]


def vertices_that_do_not_fit_are_spilled(folder):
    points, faces = grid(260)
    faces = [faces[3 * (i * 7919 % (len(faces) // 3)) + k] for i in range(len(faces) // 3) for k in range(3)]
    model = w.Model()
    model.plain(points, faces, component=w.U32)
    model.glb(f"{folder}/shuffled.glb")
    small = expect(f"{folder}/shuffled.glb", w.triangles(points, faces))
    assert small == read(f"{folder}/shuffled.glb", 256 << 20)


def vertex_colours_are_linear_and_become_srgb(folder):
    colours = [(0, 0.25, 1, 1), (0.5, 0.001, 0.7, 1), (1, 0.1, 0.003, 1)]
    for component, components, most in ((w.FLOAT, 3, None), (w.FLOAT, 4, None), (w.U8, 3, 255), (w.U8, 4, 255),
                                        (w.U16, 3, 65535), (w.U16, 4, 65535)):
        rows = [[c if most is None else round(c * most) for c in row[:components]] for row in colours]
        model = w.Model()
        item = model.plain(QUAD[:3])
        stride = {1: 4, 2: 8}.get(struct.calcsize(w.FORMATS[component]))
        item["attributes"]["COLOR_0"] = model.accessor(rows, component, stride=stride, normalized=most is not None)
        model.glb(f"{folder}/colours.glb")
        wanted = [w.rgba(*[struct.unpack("<f", struct.pack("<f", c))[0] if most is None else c / most for c in row[:3]])
                  for row in rows]
        result = expect(f"{folder}/colours.glb", w.triangles(QUAD[:3]))
        assert result["triangles"][0]["colours"] == wanted and result["triangles"][0]["flags"] == 2, (result, wanted)


def materials_become_srgb_and_keep_alpha_by_their_mode(folder):
    factor = [0.5, 0.25, 1, 0.4]
    rough = {"pbrMetallicRoughness": {"baseColorFactor": factor}}
    glossy = {"extensions": {"KHR_materials_pbrSpecularGlossiness": {"diffuseFactor": factor}}, "alphaMode": "BLEND"}
    materials = [({"name": "red", **rough}, 1), ({"name": "red", "alphaMode": "BLEND", **rough}, 0.4),
                 ({"alphaMode": "MASK", **rough}, 0), ({"alphaMode": "MASK", "alphaCutoff": 0.3, **rough}, 1),
                 (glossy, 0.4)]
    names = ["red", "red (material 1)", "material 2", "material 3", "material 4"]
    model = w.Model()
    position = model.accessor(QUAD[:3], w.FLOAT)
    primitives = [{"attributes": {"POSITION": position}, "material": model.add("materials", m)} for m, _ in materials]
    model.scene(model.node(mesh=model.mesh(*primitives, {"attributes": {"POSITION": position}})))
    model.glb(f"{folder}/materials.glb")
    result = expect(f"{folder}/materials.glb", w.triangles(QUAD[:3]) * 6)
    wanted = [[name, w.rgba(*factor[:3], alpha)] for name, (_, alpha) in zip(names, materials)]
    assert result["materials"] == wanted + [["", 0xffffffff]], result
    assert [t["material"] for t in result["triangles"]] == list(range(6))


def alpha_of_vertices_follows_the_material(folder):
    for mode, wanted in (("OPAQUE", (255, 255, 255)), ("BLEND", (0, 102, 255)), ("MASK", (0, 0, 255))):
        model = w.Model()
        item = model.plain(QUAD[:3], material=0)
        model.add("materials", {"alphaMode": mode})
        item["attributes"]["COLOR_0"] = model.accessor([(1, 1, 1, 0), (1, 1, 1, 0.4), (1, 1, 1, 1)], w.FLOAT)
        model.glb(f"{folder}/alpha.glb")
        result = expect(f"{folder}/alpha.glb", w.triangles(QUAD[:3]))
        assert tuple(c >> 24 for c in result["triangles"][0]["colours"]) == wanted, result


def the_default_scene_is_drawn_or_else_the_first_or_all_roots(folder):
    for scene, moved in ((1, [1]), (None, [0, 2]), ("none", [0, 1, 2])):
        model = w.Model()
        mesh = model.mesh({"attributes": {"POSITION": model.accessor(QUAD[:3], w.FLOAT)}})
        nodes = [model.node(mesh=mesh, translation=[i, 0, 0]) for i in range(3)]
        model.scene(nodes[0], nodes[2])
        model.scene(nodes[1])
        if scene == "none":
            del model.json["scenes"]
        elif scene is not None:
            model.json["scene"] = scene
        model.glb(f"{folder}/scene.glb")
        expect(f"{folder}/scene.glb", [t for x in moved for t in w.triangles(QUAD[:3], None, w.compose([x, 0, 0]))])


def parts_are_nodes_by_their_path(folder):
    model = w.Model()
    mesh = model.mesh({"attributes": {"POSITION": model.accessor(QUAD[:3], w.FLOAT)}}, name="bolt")
    nameless = model.mesh({"attributes": {"POSITION": 0}})
    leaves = [model.node(mesh=mesh, name="wheel"), model.node(mesh=mesh), model.node(mesh=nameless),
              model.node(mesh=mesh, name="wheel")]
    model.scene(model.node(name="car", children=[model.node(children=leaves), model.node(name="no mesh")]))
    model.glb(f"{folder}/parts.glb")
    expect(f"{folder}/parts.glb", w.triangles(QUAD[:3]) * 4,
           parts=["car/node 4/wheel", "car/node 4/bolt", "car/node 4/node 2", "car/node 4/wheel (node 3)"])


def parts_whose_names_are_taken_with_a_number_too_are_their_own(folder):
    model = w.Model()
    mesh = model.mesh({"attributes": {"POSITION": model.accessor(QUAD[:3], w.FLOAT)}})
    names = ["Box", "Box (node 3)", "Box (node 3, 2)", "Box", "é" * 800, "é" * 800]
    model.scene(*[model.node(mesh=mesh, name=name) for name in names])
    model.glb(f"{folder}/taken.glb")
    result = expect(f"{folder}/taken.glb", w.triangles(QUAD[:3]) * 6)
    assert result["parts"][:4] == names[:3] + ["Box (node 3, 3)"], result["parts"]
    long, longer = result["parts"][4:]
    assert set(long) == {"é"} and longer == long + " (node 5)", result["parts"][4:]


def an_accessor_may_have_two_uses(folder):
    """Integers of normals are always normalized, those of positions where the accessor says so: whatever comes first."""
    rows = [(0, 0, 0), (100, 3, 0), (120, 90, 7), (1, 2, 3)]
    for order in (1, -1):
        model = w.Model()
        shared, other = model.accessor(rows, w.I16, stride=8), model.accessor(QUAD, w.FLOAT)
        index = model.accessor(QUAD_INDICES, w.U8)
        primitives = [{"attributes": {"POSITION": shared}, "indices": index},
                      {"attributes": {"POSITION": other, "NORMAL": shared}, "indices": index}]
        model.scene(model.node(mesh=model.mesh(*primitives[::order])))
        model.glb(f"{folder}/uses.glb")
        expect(f"{folder}/uses.glb", [t for points in (rows, QUAD)[::order] for t in w.triangles(points, QUAD_INDICES)])


def twenty_thousand_parts_fit(folder):
    model = w.Model()
    mesh = model.mesh({"attributes": {"POSITION": model.accessor(QUAD[:3], w.FLOAT)}})
    count = 20000
    model.scene(*[model.node(mesh=mesh, name=f"a part with quite a long name, number {i}", translation=[i, 0, 0])
                  for i in range(count)])
    model.glb(f"{folder}/many.glb")
    wanted = [t for x in range(count) for t in w.triangles(QUAD[:3], None, w.compose([x, 0, 0]))]
    result = expect(f"{folder}/many.glb", wanted, memory=64 << 20)
    assert len(result["parts"]) == count and result["parts"][19999].endswith("19999")


def instances_are_expanded(folder):
    places = [([i, 0, 2], [0, HALF, 0, HALF] if i % 2 else [0, 0, 0, 1], [1, -1 if i == 2 else 2, 1]) for i in range(5)]
    for rotations in (w.FLOAT, w.I16):
        model = w.Model()
        scale = 1 if rotations == w.FLOAT else 32767
        turns = [[x if scale == 1 else round(x * scale) for x in place[1]] for place in places]
        attributes = {"TRANSLATION": model.accessor([p[0] for p in places], w.FLOAT),
                      "ROTATION": model.accessor(turns, rotations, normalized=scale > 1),
                      "SCALE": model.accessor([p[2] for p in places], w.FLOAT)}
        node = {"translation": [0, 7, 0], "extensions": {"EXT_mesh_gpu_instancing": {"attributes": attributes}}}
        model.plain(QUAD, QUAD_INDICES, node=node)
        model.json["extensionsRequired"] = ["EXT_mesh_gpu_instancing"]
        model.glb(f"{folder}/instances.glb")
        wanted = [t for place in places
                  for t in w.triangles(QUAD, QUAD_INDICES, w.multiply(w.compose([0, 7, 0]), w.compose(*place)))]
        result = expect(f"{folder}/instances.glb", wanted)
        assert result["parts"] == ["node 0"]


def unknown_chunks_extras_and_padding_are_passed_over(folder):
    model = w.Model()
    item = model.plain(QUAD, QUAD_INDICES)
    item["extras"] = {"deep": [[[{"extras": "}]\\\""}]]], "n": 1e300}
    model.json["extras"] = "data:not one of ours"
    model.json["animations"] = [{"anything": [1, 2, {"x": None}]}]
    model.json["images"] = [{"uri": "data:image/png;base64,AAAA"}]
    model.json["extensionsUsed"] = ["VENDOR_something", "KHR_materials_unlit", "KHR_texture_transform"]
    chunk = struct.pack("<II", 8, 0x12345678) + b"unknown!"
    model.glb(f"{folder}/chunks.glb", chunks_after=chunk)
    expect(f"{folder}/chunks.glb", w.triangles(QUAD, QUAD_INDICES))
    w.save(f"{folder}/grown.glb", open(f"{folder}/chunks.glb", "rb").read() + b"after the end")
    expect(f"{folder}/grown.glb", w.triangles(QUAD, QUAD_INDICES))


def names_that_are_not_utf8_are_read(folder):
    model = w.Model()
    model.plain(QUAD, QUAD_INDICES, node={"name": "L?ngs"})
    text = json.dumps({**model.json, "buffers": [{"byteLength": len(model.buffers[0])}]}).encode()
    model.glb(f"{folder}/latin.glb", json_text=text.replace(b"L?ngs", b"L\xe4ngs"))
    expect(f"{folder}/latin.glb", w.triangles(QUAD, QUAD_INDICES), parts=["L?ngs"])


# ---- compressed

def compressed(model, kind, count, stride, data, mode="ATTRIBUTES", filter_name=None):
    """A view packed by the library's encoder; the plain buffer is the fallback, which holds nothing."""
    packed, _ = pack(kind, count, stride, data=data)
    at = model.buffers[0]
    at.extend(b"\0" * (-len(at) % 4))
    extension = {"buffer": 0, "byteOffset": len(at), "byteLength": len(packed), "byteStride": stride, "count": count,
                 "mode": mode, **({"filter": filter_name} if filter_name else {})}
    at.extend(packed)
    view = {"buffer": 1, "byteLength": count * stride, "extensions": {"EXT_meshopt_compression": extension}}
    if mode == "ATTRIBUTES":
        view["byteStride"] = stride
    return model.add("bufferViews", view)


def save_compressed(model, path):
    model.json["extensionsRequired"] = ["EXT_meshopt_compression", "KHR_mesh_quantization"]
    model.json["buffers"] = [{"byteLength": len(model.buffers[0])},
                             {"byteLength": 1 << 20, "extensions": {"EXT_meshopt_compression": {"fallback": True}}}]
    w.save(path, w.glb_bytes(json.dumps(model.json), bytes(model.buffers[0])))


def canonical(triangles):
    """The index codec may turn a triangle's corners."""
    return sorted(min(t[i:] + t[:i] for i in range(3)) for t in triangles)


def meshopt_views_are_decompressed(folder):
    points, faces = grid(50)
    for mode, size in (("TRIANGLES", 2), ("TRIANGLES", 4), ("INDICES", 2), ("INDICES", 4)):
        model = w.Model()
        component = w.U16 if size == 2 else w.U32
        position = model.add("accessors", {"bufferView": compressed(model, "attributes", len(points), 12,
                                                                    w.pack(points, w.FLOAT)),
                                           "componentType": w.FLOAT, "type": "VEC3", "count": len(points)})
        index = model.add("accessors", {"bufferView": compressed(model, mode.lower(), len(faces), size,
                                                                 w.pack([(i,) for i in faces], component), mode),
                                        "componentType": component, "type": "SCALAR", "count": len(faces)})
        model.scene(model.node(mesh=model.mesh({"attributes": {"POSITION": position}, "indices": index})))
        path = f"{folder}/meshopt_{mode}{size}.glb"
        save_compressed(model, path)
        wanted = w.triangles(points, faces)
        if mode == "INDICES":
            expect(path, wanted)
            continue
        result = read(path)
        got = [[tuple(t["positions"][3 * c:3 * c + 3]) for c in range(3)] for t in result["triangles"]]
        assert result["count"] == len(wanted)
        assert w.position_hash(canonical(got)) == w.position_hash(canonical(wanted[:4096])) or len(wanted) > 4096


def meshopt_views_that_do_not_fit_together_take_turns(folder):
    """Positions and normals of many vertices, of which the least budget holds one at a time."""
    count = 200000
    points = [(i % 500, i // 500, i % 7) for i in range(count)]
    normals = [((1, 0, 0), (0, 1, 0), (0, 0, 1))[i // 1000 % 3] for i in range(count)]
    faces = [corner for i in range(0, count - 501, 4000) for corner in (i, i + 1, i + 500)]
    model = w.Model()
    views = [compressed(model, "attributes", count, 12, w.pack(rows, w.FLOAT)) for rows in (points, normals)]
    at = [model.add("accessors", {"bufferView": view, "componentType": w.FLOAT, "type": "VEC3", "count": count})
          for view in views]
    mesh = model.mesh({"attributes": {"POSITION": at[0], "NORMAL": at[1]}, "indices": model.accessor(faces, w.U32)})
    model.scene(*[model.node(mesh=mesh) for _ in range(3)])
    save_compressed(model, f"{folder}/turns.glb")
    result = expect(f"{folder}/turns.glb", w.triangles(points, faces) * 3)
    for index, triangle in enumerate(result["triangles"]):
        first = faces[3 * (index % (len(faces) // 3))]
        assert triangle["normals"][:3] == list(map(float, normals[first])), (index, triangle)


def meshopt_filters_are_undone(folder):
    points = [(0, 0, 0), (1.5, 0, -0.25), (1, 3, 0.5), (0, 1024, 7)]
    normals = [(0, 0, 1), (0.6, 0, 0.8), (-HALF, HALF, 0), (0.36, -0.48, -0.8)]
    turns = [(0, 0, 0, 1), (0, HALF, 0, HALF), (0.5, 0.5, 0.5, 0.5), (HALF, 0, HALF, 0)]
    for stride, component in ((4, w.I8), (8, w.I16)):
        model = w.Model()
        position = model.add("accessors", {"bufferView": compressed(model, "exponential", 4, 12,
                                                                    w.pack(points, w.FLOAT),
                                                                    filter_name="EXPONENTIAL"),
                                           "componentType": w.FLOAT, "type": "VEC3", "count": 4})
        normal = model.add("accessors", {"bufferView": compressed(model, "octahedral", 4, stride,
                                                                  w.pack([(*n, 0) for n in normals], w.FLOAT),
                                                                  filter_name="OCTAHEDRAL"),
                                         "componentType": component, "type": "VEC3", "count": 4, "normalized": True})
        rotation = model.add("accessors", {"bufferView": compressed(model, "quaternion", 4, 8, w.pack(turns, w.FLOAT),
                                                                    filter_name="QUATERNION"),
                                           "componentType": w.I16, "type": "VEC4", "count": 4, "normalized": True})
        mesh = model.mesh({"attributes": {"POSITION": position, "NORMAL": normal},
                           "indices": model.accessor(QUAD_INDICES, w.U16)})
        instancing = {"EXT_mesh_gpu_instancing": {"attributes": {"ROTATION": rotation}}}
        model.scene(model.node(mesh=mesh, extensions=instancing))
        save_compressed(model, f"{folder}/filters.glb")
        result = read(f"{folder}/filters.glb")
        assert result.get("count") == 8, result
        for i, triangle in enumerate(result["triangles"]):
            corners = QUAD_INDICES[i % 2 * 3:i % 2 * 3 + 3]
            wanted = [x for c in corners for x in w.turn(turns[i // 2], points[c])]
            assert near(triangle["positions"], wanted, 0.2 if i >= 2 else 2e-3), (triangle, wanted)
            wanted = [x for c in corners for x in w.turn(turns[i // 2], normals[c])]
            assert near(triangle["normals"], wanted, 0.02), (triangle, wanted)


def draco(model, points, faces, method, colours=None):
    """A primitive whose corners all have a normal of their own face."""
    data = bytearray()
    for a, b, c in zip(*[iter(faces)] * 3):
        for i in (a, b, c):
            data += struct.pack("<6f", *points[i], 0, 0, 1)
            data += bytes(colours[i]) if colours else b""
    packed, told = pack("draco", method, len(faces) // 3, 1 if colours else 0, data=bytes(data))
    count = int(told)
    attributes = {"POSITION": model.add("accessors", {"componentType": w.FLOAT, "type": "VEC3", "count": count}),
                  "NORMAL": model.add("accessors", {"componentType": w.FLOAT, "type": "VEC3", "count": count})}
    if colours:
        attributes["COLOR_0"] = model.add("accessors", {"componentType": w.U8, "type": "VEC4", "count": count,
                                                        "normalized": True})
    index = model.add("accessors", {"componentType": w.U32, "type": "SCALAR", "count": len(faces)})
    ids = {name: i for i, name in enumerate(attributes)}
    return {"attributes": attributes, "indices": index,
            "extensions": {"KHR_draco_mesh_compression": {"bufferView": model.view(packed), "attributes": ids}}}


def draco_meshes_are_decompressed(folder):
    points, faces = grid(30)
    colours = [(i & 255, 0, 255, 255) for i in range(len(points))]
    for method in ("edgebreaker", "sequential"):
        for with_colours in (False, True):
            model = w.Model()
            item = draco(model, points, faces, method, colours if with_colours else None)
            model.scene(model.node(mesh=model.mesh(item), translation=[0, 0, 4], scale=[-1, 1, 1]))
            model.json["extensionsRequired"] = ["KHR_draco_mesh_compression"]
            model.glb(f"{folder}/draco.glb")
            result = read(f"{folder}/draco.glb")
            wanted = w.triangles(points, faces, w.compose([0, 0, 4], scale=[-1, 1, 1]))
            assert result.get("count") == len(wanted), result
            got = [[tuple(t["positions"][3 * c:3 * c + 3]) for c in range(3)] for t in result["triangles"]]
            assert w.position_hash(canonical(got)) == w.position_hash(canonical(wanted))
            assert all(t["flags"] == (3 if with_colours else 1) for t in result["triangles"])
            if with_colours:
                by_place = {p: c for p, c in zip(points, colours)}
                for triangle in result["triangles"]:
                    for c in range(3):
                        x, y, z = triangle["positions"][3 * c:3 * c + 3]
                        red = by_place[(-x, y, z - 4)][0] / 255
                        assert triangle["colours"][c] == w.rgba(red, 0, 1), triangle


def two_draco_meshes_take_turns(folder):
    points, faces = grid(12)
    model = w.Model()
    meshes = [model.mesh(draco(model, [(x + i, y, z) for x, y, z in points], faces, "edgebreaker"),
                         {"attributes": {"POSITION": model.accessor(QUAD[:3], w.FLOAT)}}) for i in (0, 32)]
    model.scene(*[model.node(mesh=meshes[i % 2], translation=[0, 0, 8 * i]) for i in range(4)])
    model.glb(f"{folder}/turns.glb")
    result = read(f"{folder}/turns.glb")
    wanted = [t for i in range(4) for t in
              w.triangles([(x + 32 * (i % 2), y, z) for x, y, z in points], faces, w.compose([0, 0, 8 * i])) +
              w.triangles(QUAD[:3], None, w.compose([0, 0, 8 * i]))]
    got = [[tuple(t["positions"][3 * c:3 * c + 3]) for c in range(3)] for t in result["triangles"]]
    assert w.position_hash(canonical(got)) == w.position_hash(canonical(wanted))


def an_image_makes_room_for_a_draco_mesh(folder):
    """It takes 1.3 MiB of the 4 that both share: whether a mesh fits does not depend on what came before."""
    w.save(f"{folder}/image.png", image.png([[(200, 30, 60)] * 512] * 512))
    fits = []
    for side in range(80, 124, 4):
        model = w.Model()
        painted = {"attributes": {"POSITION": model.accessor(QUAD[:3], w.FLOAT),
                                  "TEXCOORD_0": model.accessor([(0, 0), (1, 0), (0, 1)], w.FLOAT)},
                   "material": model.add("materials", {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}})}
        model.add("textures", {"source": 0})
        model.add("images", {"uri": "image.png"})
        meshes = [model.mesh(primitive) for primitive in (painted, draco(model, *grid(side), "edgebreaker"))]
        nodes = [model.node(mesh=mesh) for mesh in meshes]
        told = []
        for order in (nodes[1:], nodes, nodes[::-1]):
            model.json["scenes"] = [{"nodes": order}]
            model.glb(f"{folder}/room.glb")
            result = read(f"{folder}/room.glb")
            assert "error" in result or result["missing_images"] == 0, result["missing_image"]
            told.append("error" in result)
        assert len(set(told)) == 1, (side, told)
        fits.append(not told[0])
    assert fits == sorted(fits, reverse=True) and len(set(fits)) == 2, fits


run_tests([indices_of_all_types_and_none_give_the_same_quad, strips_and_fans_turn_as_the_specification_says,
           long_strips_and_fans_are_read_in_runs, nodes_are_placed_by_all_above_them, a_mirror_turns_the_winding,
           normals_go_by_the_inverse_transpose, meshes_are_used_again_and_again,
           points_and_lines_are_counted_and_primitives_without_positions_passed_over,
           corners_that_are_not_finite_are_counted, quantised_positions_are_normalized_where_the_accessor_says_so,
           interleaved_attributes_are_read_by_their_stride, sparse_elements_replace_those_of_the_view_or_zeros,
           sparse_indices_replace_indices, buffers_lie_beside_the_model_or_in_its_text,
           a_large_buffer_in_the_text_goes_to_scratch, vertices_that_do_not_fit_are_spilled,
           vertex_colours_are_linear_and_become_srgb, materials_become_srgb_and_keep_alpha_by_their_mode,
           alpha_of_vertices_follows_the_material, the_default_scene_is_drawn_or_else_the_first_or_all_roots,
           parts_are_nodes_by_their_path, parts_whose_names_are_taken_with_a_number_too_are_their_own,
           an_accessor_may_have_two_uses, twenty_thousand_parts_fit, instances_are_expanded,
           unknown_chunks_extras_and_padding_are_passed_over, names_that_are_not_utf8_are_read,
           meshopt_views_are_decompressed,
           meshopt_views_that_do_not_fit_together_take_turns, meshopt_filters_are_undone, draco_meshes_are_decompressed,
           two_draco_meshes_take_turns, an_image_makes_room_for_a_draco_mesh])
