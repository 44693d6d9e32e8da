"""Contact sheets side by side: the reference, ours, and four times their difference. Standard library only, so PNG files
are read and written here: 8-bit RGB without interlace, which is what stroll writes."""
import math
import struct
import zlib

SHOWN_FRAMES = 6
GAIN = 4
SIGNATURE = b"\x89PNG\r\n\x1a\n"


class Bad(Exception):
    pass


def _chunks(data, path):
    if data[:8] != SIGNATURE:
        raise Bad(f"{path} is no PNG file")
    at = 8
    while at + 12 <= len(data):
        size, = struct.unpack_from(">I", data, at)
        yield data[at + 4:at + 8], data[at + 8:at + 8 + size]
        at += 12 + size


def _paeth(a, b, c):
    pa, pb, pc = abs(b - c), abs(a - c), abs(a + b - 2 * c)
    if pa <= pb and pa <= pc:
        return a
    return b if pb <= pc else c


def _unfilter(kind, row, above):
    """In place; 3 bytes a pixel."""
    if kind == 1:
        for i in range(3, len(row)):
            row[i] = row[i] + row[i - 3] & 255
    elif kind == 2:
        row[:] = bytes(a + b & 255 for a, b in zip(row, above))
    elif kind == 3:
        for i in range(len(row)):
            row[i] = row[i] + ((row[i - 3] if i >= 3 else 0) + above[i] >> 1) & 255
    elif kind == 4:
        for i in range(len(row)):
            left, corner = (row[i - 3], above[i - 3]) if i >= 3 else (0, 0)
            row[i] = row[i] + _paeth(left, above[i], corner) & 255


def read_png(path):
    """Rows of RGB bytes."""
    packed, head = b"", None
    for kind, body in _chunks(path.read_bytes(), path):
        if kind == b"IHDR":
            head = struct.unpack(">IIBBBBB", body)
        elif kind == b"IDAT":
            packed += body
    if not head or head[2:4] != (8, 2) or head[6]:
        raise Bad(f"{path} is no PNG file of 8-bit RGB without interlace")
    width, height = head[:2]
    data, rows, above = zlib.decompress(packed), [], bytes(3 * width)
    for y in range(height):
        start = y * (3 * width + 1)
        row = bytearray(data[start + 1:start + 1 + 3 * width])
        _unfilter(data[start], row, above)
        rows.append(row)
        above = row
    return rows


def write_png(path, rows):
    def chunk(kind, body):
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
    head = struct.pack(">IIBBBBB", len(rows[0]) // 3, len(rows), 8, 2, 0, 0, 0)
    body = zlib.compress(b"".join(b"\0" + bytes(row) for row in rows), 6)
    path.write_bytes(SIGNATURE + chunk(b"IHDR", head) + chunk(b"IDAT", body) + chunk(b"IEND", b""))


def _cell(rows, frames, frame):
    """A frame's picture in a contact sheet as stroll render lays it out: by rows, in as many columns as rows."""
    columns = math.ceil(math.sqrt(frames))
    lines = math.ceil(frames / columns)
    width, height = len(rows[0]) // columns, len(rows) // lines
    left, top = frame % columns * width, frame // columns * height
    return [row[left:left + width] for row in rows[top:top + height]]


def _difference(a, b):
    return bytes(min(255, GAIN * abs(x - y)) for x, y in zip(a, b))


def side_by_side(reference, ours, frames, target):
    """One row a shown frame: reference, ours, difference. reference and ours: contact sheets of the same frames."""
    reference_rows, our_rows, lines = read_png(reference), read_png(ours), []
    if len(reference_rows) != len(our_rows) or len(reference_rows[0]) != len(our_rows[0]):
        raise Bad(f"{reference} and {ours} differ in size")
    shown = sorted({round(i * (frames - 1) / max(1, SHOWN_FRAMES - 1)) for i in range(SHOWN_FRAMES)})
    for frame in shown:
        pair = zip(_cell(reference_rows, frames, frame), _cell(our_rows, frames, frame))
        lines += [bytes(a) + bytes(b) + _difference(a, b) for a, b in pair]
    write_png(target, lines)
