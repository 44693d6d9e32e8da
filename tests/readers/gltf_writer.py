"""Writes glTF files and says which triangles they hold, with nothing of the reader in it: the standard library
alone."""
import base64
import json
import math
import os
import struct

FORMATS = {5120: "b", 5121: "B", 5122: "h", 5123: "H", 5125: "I", 5126: "f"}
TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}
FLOAT, U8, I8, U16, I16, U32 = 5126, 5121, 5120, 5123, 5122, 5125
IDENTITY = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]]


class Model:
    """A glTF in the making: every call returns the index of what it added."""

    def __init__(self):
        self.json = {"asset": {"version": "2.0"}}
        self.buffers = [bytearray()]

    def add(self, kind, item):
        self.json.setdefault(kind, []).append(item)
        return len(self.json[kind]) - 1

    def view(self, data, stride=None, buffer=0, **more):
        at = self.buffers[buffer]
        at.extend(b"\0" * (-len(at) % 4))
        item = {"buffer": buffer, "byteOffset": len(at), "byteLength": len(data), **more}
        if stride:
            item["byteStride"] = stride
        at.extend(data)
        return self.add("bufferViews", item)

    def accessor(self, rows, component, buffer=0, stride=None, **more):
        """rows: tuples, or numbers for scalars."""
        rows = [row if isinstance(row, (tuple, list)) else (row,) for row in rows]
        return self.accessor_of(pack(rows, component, stride), len(rows), len(rows[0]), component, buffer, stride,
                                **more)

    def accessor_of(self, data, count, components, component, buffer=0, stride=None, **more):
        return self.add("accessors", {"bufferView": self.view(data, stride, buffer), "componentType": component,
                                      "count": count, "type": TYPES[components], **more})

    def mesh(self, *primitives, **more):
        return self.add("meshes", {"primitives": list(primitives), **more})

    def node(self, **members):
        return self.add("nodes", members)

    def scene(self, *roots):
        return self.add("scenes", {"nodes": list(roots)})

    def plain(self, positions, indices=None, node=None, component=U16, **primitive):
        """A mesh of one primitive, a node and a scene for it."""
        item = {"attributes": {"POSITION": self.accessor(positions, FLOAT)}, **primitive}
        if indices:
            item["indices"] = self.accessor(indices, component)
        self.scene(self.node(mesh=self.mesh(item), **(node or {})))
        return item

    def glb(self, path, chunks_after=b"", json_text=None):
        if len(self.buffers[0]):
            self.json["buffers"] = [{"byteLength": len(self.buffers[0])}]
        save(path, glb_bytes(json_text or json.dumps(self.json), bytes(self.buffers[0]), chunks_after))

    def gltf(self, path, names=None, indent=None, bom=False):
        """Buffers as files of these names beside it, or in it where there are no names."""
        self.json["buffers"] = []
        for index, data in enumerate(self.buffers):
            item = {"byteLength": len(data)}
            if names:
                uri, name = names[index]
                item["uri"] = uri
                save(os.path.join(os.path.dirname(path), name), bytes(data))
            else:
                item["uri"] = "data:application/octet-stream;base64," + base64.b64encode(data).decode()
            self.json["buffers"].append(item)
        save(path, (b"\xef\xbb\xbf" if bom else b"") + json.dumps(self.json, indent=indent).encode())


def pack(rows, component, stride=None):
    data = bytearray()
    for row in rows:
        start = len(data)
        data += struct.pack("<" + FORMATS[component] * len(row), *row)
        if stride:
            data += b"\xa5" * (stride - (len(data) - start))
    return bytes(data)


def glb_bytes(text, binary, chunks_after=b""):
    text = text.encode() if isinstance(text, str) else text
    text += b" " * (-len(text) % 4)
    body = struct.pack("<II", len(text), 0x4E4F534A) + text
    if binary:
        binary += b"\0" * (-len(binary) % 4)
        body += struct.pack("<II", len(binary), 0x004E4942) + binary
    body += chunks_after
    return struct.pack("<III", 0x46546C67, 2, 12 + len(body)) + body


def save(path, data):
    os.makedirs(os.path.dirname(path), exist_ok=True)
    with open(path, "wb") as file:
        file.write(data)


# ---- what should come out

def apply(matrix, point):
    return tuple(sum(row[k] * point[k] for k in range(3)) + row[3] for row in matrix)


def multiply(a, b):
    return [[sum(row[k] * b[k][c] for k in range(3)) + (row[3] if c == 3 else 0) for c in range(4)] for row in a]


def compose(translation=(0, 0, 0), rotation=(0, 0, 0, 1), scale=(1, 1, 1)):
    """By turning each axis with q v q*, not with the reader's formula."""
    columns = [tuple(s * x for x in turn(rotation, axis)) for s, axis in zip(scale, ((1, 0, 0), (0, 1, 0), (0, 0, 1)))]
    return [[columns[0][r], columns[1][r], columns[2][r], translation[r]] for r in range(3)]


def hamilton(a, b):
    (ax, ay, az, aw), (bx, by, bz, bw) = a, b
    return (aw * bx + ax * bw + ay * bz - az * by, aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw, aw * bw - ax * bx - ay * by - az * bz)


def turn(quaternion, vector):
    x, y, z, w = quaternion
    return hamilton(hamilton(quaternion, (*vector, 0)), (-x, -y, -z, w))[:3]


def determinant(m):
    return (m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) - m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0]) +
            m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0]))


def triangles(positions, indices=None, matrix=IDENTITY, mode=4):
    """The triangles of a primitive as lists of three placed points."""
    order = list(indices) if indices is not None else list(range(len(positions)))
    if mode == 4:
        corners = [order[i:i + 3] for i in range(0, len(order) - 2, 3)]
    elif mode == 5:
        corners = [[order[i], order[i + 1], order[i + 2]] if i % 2 == 0 else [order[i], order[i + 2], order[i + 1]]
                   for i in range(len(order) - 2)]
    else:
        corners = [[order[i + 1], order[i + 2], order[0]] for i in range(len(order) - 2)]
    if determinant(matrix) < 0:
        corners = [[a, c, b] for a, b, c in corners]
    return [[apply(matrix, positions[c]) for c in three] for three in corners]


def position_hash(all_triangles):
    value = 14695981039346656037
    for triangle in all_triangles:
        for point in triangle:
            for x in point:
                for byte in struct.pack("<q", math.floor(x * 1024 + 0.5)):
                    value = (value ^ byte) * 1099511628211 % (1 << 64)
    return f"{value:016x}"


def srgb(linear):
    linear = min(max(linear, 0), 1)
    value = 12.92 * linear if linear <= 0.0031308 else 1.055 * linear ** (1 / 2.4) - 0.055
    return math.floor(value * 255 + 0.5)


def rgba(red, green, blue, alpha=1.0):
    """A linear colour as the reader gives it."""
    return srgb(red) | srgb(green) << 8 | srgb(blue) << 16 | math.floor(alpha * 255 + 0.5) << 24
