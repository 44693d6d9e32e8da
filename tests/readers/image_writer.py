"""Writes PNG files and looks colours up in them, with nothing of the reader in it: the standard library alone."""
import base64
import math
import struct
import zlib

# 16 x 16: squares of 8 x 8 of these colours, from the top left, row by row.
JPEG_COLOURS = [(200, 40, 40), (40, 160, 60), (50, 60, 190), (220, 220, 210)]
JPEG = base64.b64decode("""
/9j/4AAQSkZJRgABAQAAAQABAAD/2wBDAAMCAgMCAgMDAwMEAwMEBQgFBQQEBQoHBwYIDAoMDAsKCwsNDhIQDQ4RDgsLEBYQERMUFRUVDA8XGBYUGBIU
FRT/2wBDAQMEBAUEBQkFBQkUDQsNFBQUFBQUFBQUFBQUFBQUFBQUFBQUFBQUFBQUFBQUFBQUFBQUFBQUFBQUFBQUFBQUFBT/wAARCAAQABADAREAAhEB
AxEB/8QAFQABAQAAAAAAAAAAAAAAAAAABwn/xAAUEAEAAAAAAAAAAAAAAAAAAAAA/8QAGAEAAwEBAAAAAAAAAAAAAAAABwgJBAb/xAAUEQEAAAAAAAAA
AAAAAAAAAAAA/9oADAMBAAIRAxEAPwAUDc6pDZ0nwkoGMCxBP3XP/9k=""")
PROGRESSIVE_JPEG = base64.b64decode("""
/9j/4AAQSkZJRgABAQAAAQABAAD/2wBDAAMCAgMCAgMDAwMEAwMEBQgFBQQEBQoHBwYIDAoMDAsKCwsNDhIQDQ4RDgsLEBYQERMUFRUVDA8XGBYUGBIU
FRT/2wBDAQMEBAUEBQkFBQkUDQsNFBQUFBQUFBQUFBQUFBQUFBQUFBQUFBQUFBQUFBQUFBQUFBQUFBQUFBQUFBQUFBQUFBT/wgARCAAQABADAREAAhEB
AxEB/8QAFQABAQAAAAAAAAAAAAAAAAAABgj/xAAYAQADAQEAAAAAAAAAAAAAAAAGBwgDBf/aAAwDAQACEAMQAAABEjbqRZyeIoEwsRP9f//EABQQAQAA
AAAAAAAAAAAAAAAAACD/2gAIAQEAAQUCH//EABQRAQAAAAAAAAAAAAAAAAAAACD/2gAIAQMBAT8BH//EABQRAQAAAAAAAAAAAAAAAAAAACD/2gAIAQIB
AT8BH//EABQQAQAAAAAAAAAAAAAAAAAAACD/2gAIAQEABj8CH//EABQQAQAAAAAAAAAAAAAAAAAAACD/2gAIAQEAAT8hH//aAAwDAQACAAMAAAAQp/8A
/8QAFBEBAAAAAAAAAAAAAAAAAAAAIP/aAAgBAwEBPxAf/8QAFBEBAAAAAAAAAAAAAAAAAAAAIP/aAAgBAgEBPxAf/8QAFBABAAAAAAAAAAAAAAAAAAAA
IP/aAAgBAQABPxAf/9k=""")
ADAM7 = [(0, 0, 8, 8), (4, 0, 8, 8), (0, 4, 4, 8), (2, 0, 4, 4), (0, 2, 2, 4), (1, 0, 2, 2), (0, 1, 1, 2)]


def chunk(kind, data):
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def png(rows, kind="rgb", palette=None, transparent=None, interlaced=False, bits=8, size=None):
    """rows of tuples (or of numbers for grey and palettes). kind: rgb, rgba, grey, palette."""
    colour_type = {"grey": 0, "rgb": 2, "palette": 3, "rgba": 6}[kind]
    width, height = len(rows[0]), len(rows)

    def packed(lines):
        data = b""
        for line in lines:
            values = [x for texel in line for x in (texel if isinstance(texel, tuple) else (texel,))]
            data += b"\0" + (struct.pack(f">{len(values)}H", *values) if bits == 16 else bytes(values))
        return data
    if interlaced:
        passes = [[row[x::dx] for row in rows[y::dy]] for x, y, dx, dy in ADAM7]
        raw = b"".join(packed(lines) for lines in passes if lines and lines[0])
    else:
        raw = packed(rows)
    width, height = size or (width, height)
    out = b"\x89PNG\r\n\x1a\n"
    out += chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, bits, colour_type, 0, 0, int(interlaced)))
    if palette:
        out += chunk(b"PLTE", bytes(x for colour in palette for x in colour))
    if transparent:
        out += chunk(b"tRNS", bytes(transparent))
    return out + chunk(b"IDAT", zlib.compress(raw)) + chunk(b"IEND", b"")


def linear(code):
    encoded = code / 255
    return encoded / 12.92 if encoded <= 0.04045 else ((encoded + 0.055) / 1.055) ** 2.4


def encoded(light):
    light = min(max(light, 0), 1)
    return math.floor(255 * (12.92 * light if light <= 0.0031308 else 1.055 * light ** (1 / 2.4) - 0.055) + 0.5)


def mean(colours):
    """Of opaque colours, in linear light."""
    return tuple(encoded(sum(linear(c[k]) for c in colours) / len(colours)) for k in range(3))


def unpacked(rgba):
    return tuple(rgba >> 8 * k & 255 for k in range(4))
