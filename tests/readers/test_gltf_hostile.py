#!/usr/bin/env python3
"""Broken and hostile glTF files: each is refused with one sentence that names the place, what was expected and what was
found."""
import base64
import copy
import json
import os
import random
import re
import resource
import struct

import gltf_writer as w
import image_writer as image
from gltf_reading import LEAST, pack, read, refuse, run_tests

QUAD = [(0, 0, 0), (1, 0, 0), (1, 1, 0.5), (0, 1, 0.25)]
QUAD_INDICES = [0, 1, 2, 0, 2, 3]


def quad():
    model = w.Model()
    model.plain(QUAD, QUAD_INDICES)
    return model


def changed(path, value, model=None):
    """The quad with one member of its JSON set; path: keys and indices."""
    model = model or quad()
    at = model.json
    for key in path[:-1]:
        at = at[key]
    at[path[-1]] = value
    return model


def every_beginning_of_a_glb_is_refused(folder):
    quad().glb(f"{folder}/whole.glb")
    data = open(f"{folder}/whole.glb", "rb").read()
    path = f"{folder}/cut.glb"
    for length in list(range(1, 60)) + list(range(60, len(data), 7)):
        w.save(path, data[:length])
        refuse(path)
    for end in range(12, len(data), 5):  # the header tells the shorter length, so that chunks are cut
        w.save(path, data[:8] + struct.pack("<I", end) + data[12:end])
        refuse(path)


def every_beginning_of_a_text_is_refused(folder):
    quad().gltf(f"{folder}/whole.gltf")
    data = open(f"{folder}/whole.gltf", "rb").read()
    for length in range(1, len(data), 5):
        w.save(f"{folder}/cut.gltf", data[:length])
        refuse(f"{folder}/cut.gltf")


def chunks_that_lie_are_refused(folder):
    quad().glb(f"{folder}/whole.glb")
    data = bytearray(open(f"{folder}/whole.glb", "rb").read())
    json_bytes, = struct.unpack_from("<I", data, 12)
    cases = [(4, 1, "expected a GLB of version 2, found 1"), (8, len(data) + 1, "announces"),
             (8, 3, "announces 3 bytes"), (12, 0xffffffff, "byte 12: expected a chunk of 4294967295 bytes"),
             (16, 0x11111111, "expected a chunk of JSON"),
             (20 + json_bytes, 0x7fffffff, "expected a chunk of 2147483647 bytes"),
             (20 + json_bytes + 4, 0x22222222, "expected a uri or a binary chunk")]
    for at, value, sentence in cases:
        wrong = bytearray(data)
        struct.pack_into("<I", wrong, at, value)
        w.save(f"{folder}/lie.glb", bytes(wrong))
        refuse(f"{folder}/lie.glb", sentence)
    longer = quad()
    longer.json["buffers"] = [{"byteLength": 64}]
    w.save(f"{folder}/longer.glb", w.glb_bytes(json.dumps(longer.json), bytes(longer.buffers[0])))
    refuse(f"{folder}/longer.glb", "buffers[0]: expected 64 bytes, found a binary chunk of 60")


def what_does_not_fit_its_buffer_is_refused(folder):
    most = (1 << 63) - 1
    cases = [(("accessors", 0, "byteOffset"), 1, "end after the"), (("accessors", 0, "count"), 5, "accessors[0]"),
             (("accessors", 0, "count"), 4294967295, "accessors[0]"), (("accessors", 0, "count"), 1 << 40, "count"),
             (("accessors", 0, "byteOffset"), most, "accessors[0]"), (("accessors", 0, "count"), -1, "not negative"),
             (("accessors", 0, "count"), 1.5, "whole number"),
             (("accessors", 0, "bufferView"), 9, "bufferViews from 0 to 1, found 9"),
             (("bufferViews", 0, "byteLength"), 1 << 40, "bufferViews[0]"),
             (("bufferViews", 0, "byteOffset"), most, "bufferViews[0]"),
             (("bufferViews", 0, "buffer"), 3, "buffers from 0 to 0, found 3"),
             (("bufferViews", 0, "byteStride"), 4096, "byteStride"),
             (("bufferViews", 0, "byteStride"), 2048, "2048 apart"),
             (("accessors", 0, "componentType"), 5124, "componentType"), (("accessors", 0, "type"), "VEC5", "type"),
             (("accessors", 0, "type"), "VEC2", "POSITION"), (("accessors", 1, "componentType"), 5126, "indices"),
             (("meshes", 0, "primitives", 0, "attributes", "POSITION"), 7, "primitives[0]", "accessors from 0 to 1, found 7"),
             (("meshes", 0, "primitives", 0, "indices"), 7, "primitives[0]", "accessors from 0 to 1, found 7"),
             (("meshes", 0, "primitives", 0, "attributes", "NORMAL"), 1, "NORMAL"),
             (("meshes", 0, "primitives", 0, "material"), 0, "materials, of which there are none, found 0"),
             (("meshes", 0, "primitives", 0, "mode"), 7, "mode")]
    for path, value, *sentence in cases:
        changed(path, value).glb(f"{folder}/wrong.glb")
        refuse(f"{folder}/wrong.glb", *sentence)


def indices_beyond_the_vertices_are_refused(folder):
    for index in (4, 65535):
        model = w.Model()
        model.plain(QUAD, [0, 1, 2, 0, 2, index])
        model.glb(f"{folder}/index.glb")
        refuse(f"{folder}/index.glb", "accessors[1]: expected indices below 4", f"found {index} in triangle 1")


def bad_graphs_are_refused(folder):
    cases = [([{"children": [1]}, {"children": [0]}], [0], "cycle"), ([{"children": [0]}], [0], "cycle"),
             ([{"children": [2]}, {"children": [2]}, {}], [0, 1], "both have node 2"),
             ([{"children": [1, 1]}, {}], [0], "both have node 1"),
             ([{"children": [5]}], [0], "nodes[0].children: expected an index of nodes from 0 to 0, found 5"),
             ([{}, {}], [0, 0], "there twice"), ([{"children": [1]}, {}], [1], "the child of another"),
             ([{}], [3], "found 3"),
             ([{"mesh": 4}], [0], "nodes[0].mesh: expected an index of meshes from 0 to 0, found 4"), ([{"children": "all"}], [0], "a list"),
             ([{"matrix": [1, 2, 3]}], [0], "16 numbers"), ([{"translation": [1, "x", 3]}], [0], "3 numbers")]
    for nodes, roots, sentence in cases:
        model = quad()
        model.json["nodes"], model.json["scenes"] = nodes, [{"nodes": roots}]
        model.glb(f"{folder}/graph.glb")
        refuse(f"{folder}/graph.glb", sentence)
    for count, refused in ((1000, False), (2000, True)):
        model = quad()
        model.json["nodes"] = [{"children": [i + 1], "translation": [1, 0, 0]} for i in range(count)] + [{"mesh": 0}]
        model.glb(f"{folder}/deep.glb")
        if refused:
            refuse(f"{folder}/deep.glb", "nodes above it")
        else:
            assert read(f"{folder}/deep.glb")["triangles"][0]["positions"][0] == count


def transforms_that_overflow_drop_their_triangles(folder):
    model = w.Model()
    mesh = model.plain(QUAD, QUAD_INDICES)
    model.json["nodes"] = [{"children": [1], "scale": [1e300, 1, 1]}, {"mesh": 0, "scale": [1e300, 1, 1]}]
    model.json["scenes"] = [{"nodes": [0]}]
    model.glb(f"{folder}/inf.glb")
    assert mesh and read(f"{folder}/inf.glb")["nonfinite"] == 2
    text = json.dumps({**model.json, "buffers": [{"byteLength": len(model.buffers[0])}]})
    model.glb(f"{folder}/nan.glb", json_text=text.replace("1e+300", "NaN"))
    refuse(f"{folder}/nan.glb", "expected JSON")
    model = w.Model()
    translation = model.accessor([(0, 0, 0), (float("nan"), 0, 0)], w.FLOAT)
    instancing = {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": translation}}}
    model.plain(QUAD, QUAD_INDICES, node={"extensions": instancing})
    model.glb(f"{folder}/instance.glb")
    result = read(f"{folder}/instance.glb")
    assert (result["count"], result["nonfinite"]) == (2, 2), result


def sparse_elements_that_are_not_in_order_are_refused(folder):
    for indices, sentence in (([2, 1], "growing indices below 4, found 1 at 1"), ([1, 1], "found 1 at 1"),
                              ([1, 4], "found 4 at 1"),
                              ([0, 1, 2, 3, 3], "expected at most 4 elements, found 5")):
        model = quad()
        model.json["accessors"][0]["sparse"] = {
            "count": len(indices), "indices": {"bufferView": model.view(bytes(indices)), "componentType": w.U8},
            "values": {"bufferView": model.view(b"\0" * 60)}}
        model.glb(f"{folder}/sparse.glb")
        refuse(f"{folder}/sparse.glb", sentence)
    model.json["accessors"][0]["sparse"]["count"] = 1 << 62
    model.glb(f"{folder}/sparse.glb")
    refuse(f"{folder}/sparse.glb", "expected at most 4 elements")
    model.json["accessors"][0]["sparse"].update(count=4, indices={"bufferView": 0, "componentType": w.FLOAT})
    model.glb(f"{folder}/sparse.glb")
    refuse(f"{folder}/sparse.glb", "unsigned type")


def buffers_that_are_not_there_are_refused(folder):
    model = quad()
    model.gltf(f"{folder}/beside.gltf", [("a.bin", "a.bin")])
    os.remove(f"{folder}/a.bin")
    refuse(f"{folder}/beside.gltf", "buffers[0]", "a.bin", "No such file")
    w.save(f"{folder}/a.bin", b"\0" * 20)
    refuse(f"{folder}/beside.gltf", "expected 60 bytes, found 20")
    pointer = b"version https://git-lfs.github.com/spec/v1\noid sha256:" + b"0" * 64 + b"\nsize 60000\n"
    w.save(f"{folder}/a.bin", pointer)
    model.gltf(f"{folder}/longer.gltf", [("b.bin", "b.bin")])
    text = open(f"{folder}/longer.gltf").read().replace("b.bin", "a.bin").replace('{"byteLength": 60,', '{"byteLength": 6000,')
    w.save(f"{folder}/longer.gltf", text.encode())
    refuse(f"{folder}/longer.gltf", "a.bin, which is a Git LFS pointer", "git lfs pull")
    for ending in ("gltf", "glb", "ply", "stl", "obj", "fbx", "anything"):
        w.save(f"{folder}/pointer.{ending}", pointer)
        refuse(f"{folder}/pointer.{ending}", "found a Git LFS pointer", "git lfs pull")
    for uri, sentence in (("http://example.org/a.bin", "a file beside the model"), ("/etc/passwd", "a file beside"),
                          ("file:///etc/passwd", "a file beside"), ("\\\\host\\a.bin", "a file beside"),
                          ("a%00.bin", "a zero"),
                          ("", "a file beside"), (".", "found a folder"), ("data:;base64,AA", "letters"),
                          ("data:;base64," + "!" * 100, "expected base64"),
                          ("data:text/plain," + "x" * 100, "in base64"),
                          ("data:;base64" + "x" * 100, "with a comma"),
                          ("data:;base64,AAAA=" + "A" * 100, "found a data URI of 3"),
                          ("data:;base64," + "\\n" * 100, "expected base64"),
                          ("data:;base64," + "\n" * 100, "expected base64"),
                          ("data:;base64," + "é" * 100, "expected base64")):
        model.json["buffers"] = [{"byteLength": 60, "uri": uri}]
        w.save(f"{folder}/uri.gltf", json.dumps(model.json).encode())
        refuse(f"{folder}/uri.gltf", sentence)


def the_notation_for_data_in_the_text_cannot_be_forged(folder):
    model = quad()
    data = base64.b64encode(bytes(model.buffers[0]))
    for uri in (b"@0+18446744073709551615", b"@18446744073709551000+800", b"@0+100", b"@70+100", b"@5", b"@-1+5",
                b";base64," + data):
        model.json["buffers"] = [{"byteLength": 60, "uri": "HERE"}]
        w.save(f"{folder}/forged.gltf", json.dumps(model.json).encode().replace(b"HERE", b"\\u0064ata:" + uri))
        refuse(f"{folder}/forged.gltf", "buffers[0]: expected")


def images_in_a_buffer_that_is_too_short_leave_nothing_open(folder):
    count = 300
    model = w.Model()
    position = model.accessor(QUAD[:3], w.FLOAT)
    texcoord = model.accessor([(0, 0), (1, 0), (0, 1)], w.FLOAT)
    for i in range(count + 1):
        model.add("images", {"bufferView": len(model.json["bufferViews"]) + i} if i < count else {"uri": "good.png"})
        model.add("textures", {"source": i})
        model.add("materials", {"pbrMetallicRoughness": {"baseColorTexture": {"index": i}}})
    model.scene(model.node(mesh=model.mesh(*[{"attributes": {"POSITION": position, "TEXCOORD_0": texcoord}, "material": i}
                                             for i in range(count + 1)])))
    for _ in range(count):
        model.add("bufferViews", {"buffer": 1, "byteLength": 100})
    w.save(f"{folder}/good.png", image.png([[(1, 2, 3)]]))
    w.save(f"{folder}/short.bin", b"\0" * 50)
    model.json["buffers"] = [{"byteLength": len(model.buffers[0])}, {"byteLength": 1000, "uri": "short.bin"}]
    w.save(f"{folder}/images.glb", w.glb_bytes(json.dumps(model.json), bytes(model.buffers[0])))
    before = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (64, before[1]))
    try:
        result = read(f"{folder}/images.glb")
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, before)
    assert (result["count"], result["missing_images"]) == (count + 1, count), result
    assert "short.bin" in result["missing_image"], result["missing_image"]


def extensions_that_must_be_understood_are_refused_by_name(folder):
    changed(("extensionsRequired",), ["KHR_materials_unlit", "VENDOR_shapes"]).glb(f"{folder}/required.glb")
    refuse(f"{folder}/required.glb", "requires the extension VENDOR_shapes", "export the model without it")
    changed(("extensionsRequired",), ["KHR_meshopt_compression"]).glb(f"{folder}/required.glb")
    refuse(f"{folder}/required.glb", "requires the extension KHR_meshopt_compression", "by gltfpack with -c or -cc")
    for asset, sentence in (({"version": "1.0"}, "found version 1.0"),
                            ({"version": "2.0", "minVersion": "2.1"}, "version 2.1"),
                            ({}, "version unknown")):
        changed(("asset",), asset).glb(f"{folder}/asset.glb")
        refuse(f"{folder}/asset.glb", sentence)
    w.save(f"{folder}/old.gltf", b'{"asset": {}, "accessors": {"a": {}}}')
    refuse(f"{folder}/old.gltf", "version unknown")
    w.save(f"{folder}/older.gltf", b'{"accessors": {"a": {}}, "asset": {"version": "1.0"}}')
    refuse(f"{folder}/older.gltf", "assimp")


def bad_json_is_refused_with_its_place(folder):
    cases = [("[]", "byte 0: expected the '{'"), ("{", "expected a name"), ('{"asset"', "a colon"),
             ('{"asset": }', "a value"),
             ('{"nodes": [}', "a value"), ('{"nodes": [{]}', "JSON"), ('{"nodes": [{} {}]}', "a comma"),
             ('{"nodes": [{},]}', "a value"),
             ('{"asset": {"version": "2.0"}} x', "the end"), ('{"asset": {"version": "2.0}}', "the end of a string"),
             ('{"nodes": [{} 2]}', "a comma"),
             ('{"nodes": [{"mesh": 1 2}]}', "expected JSON in its nodes"),
             ("{\"nodes\": [" + "[" * 300, "nests more than"),
             ('{"anything": ' + '{"a":' * 300, "nests more than"), ('{"nodes": [{"a": \x00}]}', "JSON"),
             ('{"nodes": [{}], "nodes": [{}]}', "stand in it twice"),
             ('{"nodes": [3]}', "nodes[0]: expected an object"),
             ('{"scene": -1}', "an index"), ("{}", "expected an asset")]
    for text, sentence in cases:
        w.save(f"{folder}/bad.gltf", text.encode())
        refuse(f"{folder}/bad.gltf", sentence)


def the_memory_that_is_told_would_do(path, *parts):
    """And not a third of it."""
    sentence = refuse(path, "the memory budget allows", *parts)
    told = int(re.search(r"reading it takes about (\d+)M of memory$", sentence).group(1)) << 20
    assert LEAST < told < 40 * LEAST, sentence
    refuse(path, *parts, memory=max(LEAST, told // 3))
    assert read(path, told)["count"] == 2


def json_beyond_the_budget_is_refused(folder):
    model = quad()
    model.json["nodes"] = [{"name": "n" * 40} for _ in range(30000)] + [{"mesh": 0}]
    model.json["scenes"] = [{"nodes": [30000]}]
    model.glb(f"{folder}/nodes.glb")
    the_memory_that_is_told_would_do(f"{folder}/nodes.glb", "what its JSON describes")
    model = quad()
    model.json["nodes"][0]["name"] = "n" * 200000
    model.glb(f"{folder}/name.glb")
    the_memory_that_is_told_would_do(f"{folder}/name.glb", "this part of its JSON is 2000")
    model.json["nodes"][0] = {"mesh": 0, "extras": {"text": "n" * 2000000}}
    model.glb(f"{folder}/extras.glb")
    assert read(f"{folder}/extras.glb")["count"] == 2


def compressed_views_that_lie_are_refused(folder):
    packed, _ = pack("attributes", 4, 12, data=w.pack(QUAD, w.FLOAT))
    model = quad()
    at = model.view(packed)
    good = {"buffer": 0, "byteOffset": model.json["bufferViews"][at]["byteOffset"], "byteLength": len(packed),
            "byteStride": 12, "count": 4, "mode": "ATTRIBUTES"}
    model.json["bufferViews"][0] = {"buffer": 0, "byteLength": 48, "extensions": {"EXT_meshopt_compression": good}}
    model.glb(f"{folder}/meshopt.glb")
    assert read(f"{folder}/meshopt.glb")["count"] == 2
    large = copy.deepcopy(model)
    zeros, _ = pack("attributes", 1 << 20, 12, data=bytes(12 << 20))
    place = large.json["bufferViews"][large.view(zeros)]["byteOffset"]
    large.json["bufferViews"][0]["extensions"]["EXT_meshopt_compression"].update(
        count=1 << 20, byteLength=len(zeros), byteOffset=place)
    large.glb(f"{folder}/large.glb")
    the_memory_that_is_told_would_do(f"{folder}/large.glb", "a compressed buffer view takes")
    cases = [({"byteStride": 6}, "do not fit"), ({"byteStride": 260}, "1 to 256"), ({"byteStride": 0}, "1 to 256"),
             ({"mode": "TRIANGLES"}, "do not fit"), ({"mode": "INDICES", "byteStride": 12}, "do not fit"),
             ({"mode": "NOTHING"}, "EXT_meshopt_compression knows"), ({"filter": "OCTAHEDRAL"}, "do not fit"),
             ({"filter": "QUATERNION"}, "do not fit"), ({"count": 3}, "do not fit"), ({"count": 1 << 61}, "do not fit"),
             ({"count": 1 << 31}, "decompressed", "of memory"), ({"byteLength": 1 << 40}, "end after the buffer"),
             ({"byteLength": 9}, "damaged"), ({"byteLength": 0}, "damaged"), ({"byteOffset": 0}, "damaged"),
             ({"buffer": 5}, "found 5")]
    for change, *sentence in cases:
        wrong = copy.deepcopy(model)
        wrong.json["bufferViews"][0]["extensions"]["EXT_meshopt_compression"].update(change)
        wrong.glb(f"{folder}/wrong.glb")
        refuse(f"{folder}/wrong.glb", *sentence)


def draco_attributes_beyond_the_budget_are_refused(folder):
    """A thousand points of a hundred attributes that nobody asks for pack to next to nothing."""
    points, faces = [(i % 40, i // 40, i % 3) for i in range(1600)], []
    for i in range(39 * 39):
        at = i // 39 * 40 + i % 39
        faces += [at, at + 1, at + 40, at + 1, at + 41, at + 40]
    corner = b"".join(struct.pack("<6f", *points[i], 0, 0, 1) for i in faces)
    for method in ("sequential", "edgebreaker"):
        for extra, refused in ((0, False), (100, True), (300, True)):
            if extra == 300 and method == "edgebreaker":
                continue  # which the encoder does not survive
            packed, told = pack("draco", method, len(faces) // 3, 0, extra, data=corner)
            model = w.Model()
            model.json["accessors"] = [{"componentType": w.FLOAT, "type": "VEC3", "count": int(told)},
                                       {"componentType": w.U32, "type": "SCALAR", "count": len(faces)}]
            draco = {"bufferView": model.view(packed), "attributes": {"POSITION": 0}}
            mesh = model.mesh({"attributes": {"POSITION": 0}, "indices": 1,
                               "extensions": {"KHR_draco_mesh_compression": draco}})
            model.scene(model.node(mesh=mesh))
            path = f"{folder}/draco.glb"
            model.glb(path)
            if not refused:
                assert read(path)["count"] == len(faces) // 3
                continue
            if extra == 300:
                refuse(path, "more than the 256 attributes that are read", memory=1 << 30)
                continue
            memory = LEAST
            for _ in range(2):  # the faces may be too much before the attributes are known
                if "error" in read(path, memory):
                    sentence = refuse(path, "a Draco mesh", "the memory budget allows", memory=memory)
                    memory = int(re.search(r"about (\d+)M of memory$", sentence).group(1)) << 20
            assert memory > LEAST and read(path, memory)["count"] == len(faces) // 3


def draco_meshes_that_lie_are_refused(folder):
    corner = b"".join(struct.pack("<6f", *QUAD[i], 0, 0, 1) for i in QUAD_INDICES)
    packed, told = pack("draco", "sequential", 2, 0, data=corner)
    model = quad()
    model.json["accessors"][0]["count"] = int(told)
    for accessor in model.json["accessors"]:
        del accessor["bufferView"]
    view = model.view(packed)
    draco = {"bufferView": view, "attributes": {"POSITION": 0}}
    model.json["meshes"][0]["primitives"][0]["extensions"] = {"KHR_draco_mesh_compression": draco}
    model.glb(f"{folder}/draco.glb")
    assert read(f"{folder}/draco.glb")["count"] == 2
    offset = model.json["bufferViews"][view]["byteOffset"]
    data = bytes(model.buffers[0])
    cases = [({"bufferView": 9}, data, "found 9"), ({"attributes": {"POSITION": 7}}, data, "do not fit accessors[0]"),
             ({}, data[:offset] + b"DRACO" + b"\xff" * (len(data) - offset - 5), "Draco mesh of version 2.2"),
             ({}, data[:offset + 11] + b"\xff\xff\xff\x0f" + data[offset + 15:], "at most 2 faces"),
             ({}, data[:offset + 16] + b"\0" * (len(data) - offset - 16), "Draco")]
    for change, binary, sentence in cases:
        wrong = copy.deepcopy(model)
        wrong.json["meshes"][0]["primitives"][0]["extensions"]["KHR_draco_mesh_compression"].update(change)
        wrong.buffers[0] = bytearray(binary)
        wrong.glb(f"{folder}/wrong.glb")
        refuse(f"{folder}/wrong.glb", sentence)
    chance = random.Random(7)
    for _ in range(300):  # any answer is right that comes soon and is no crash
        binary = bytearray(data)
        for _ in range(chance.randint(1, 4)):
            binary[chance.randrange(offset, len(binary))] = chance.randrange(256)
        wrong = copy.deepcopy(model)
        wrong.buffers[0] = binary
        wrong.glb(f"{folder}/wrong.glb")
        read(f"{folder}/wrong.glb")


def any_byte_of_a_model_may_be_another(folder):
    model = quad()
    model.scene(model.node(children=[0], scale=[2, 1, 1]))
    model.glb(f"{folder}/whole.glb")
    data = open(f"{folder}/whole.glb", "rb").read()
    chance = random.Random(5)
    for _ in range(600):
        wrong = bytearray(data)
        for _ in range(chance.randint(1, 3)):
            wrong[chance.randrange(len(wrong))] = chance.randrange(256)
        w.save(f"{folder}/wrong.glb", bytes(wrong))
        result = read(f"{folder}/wrong.glb", LEAST)
        assert "error" in result or result["count"] <= 4, result


run_tests([every_beginning_of_a_glb_is_refused, every_beginning_of_a_text_is_refused, chunks_that_lie_are_refused,
           what_does_not_fit_its_buffer_is_refused, indices_beyond_the_vertices_are_refused, bad_graphs_are_refused,
           transforms_that_overflow_drop_their_triangles, sparse_elements_that_are_not_in_order_are_refused,
           buffers_that_are_not_there_are_refused,
           the_notation_for_data_in_the_text_cannot_be_forged, images_in_a_buffer_that_is_too_short_leave_nothing_open,
           extensions_that_must_be_understood_are_refused_by_name,
           bad_json_is_refused_with_its_place, json_beyond_the_budget_is_refused, compressed_views_that_lie_are_refused,
           draco_meshes_that_lie_are_refused,
           draco_attributes_beyond_the_budget_are_refused, any_byte_of_a_model_may_be_another])
