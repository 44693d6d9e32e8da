#!/usr/bin/env python3
"""stroll compare finds each kind of difference that it names, and nothing where there is none.

usage: test_compare.py PROGRAM. The images are written here, byte by byte."""
import json
import math
import os
import shutil
import struct
import subprocess
import sys
import tempfile
import zlib

WIDTH, HEIGHT, FRAMES = 48, 32, 3
INFINITY = float("inf")
FOCAL = HEIGHT / (2 * math.tan(math.radians(30)))


def write_png(path, pixels):
    def chunk(kind, data):
        body = kind + data
        return struct.pack(">I", len(data)) + body + struct.pack(">I", zlib.crc32(body))

    rows = b"".join(b"\0" + bytes(v for pixel in row for v in pixel) for row in pixels)
    head = struct.pack(">IIBBBBB", WIDTH, HEIGHT, 8, 2, 0, 0, 0)
    with open(path, "wb") as file:
        file.write(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(rows)) +
                   chunk(b"IEND", b""))


def write_pfm(path, depth):
    with open(path, "wb") as file:
        file.write(b"Pf\n%d %d\n-1.0\n" % (WIDTH, HEIGHT))
        for row in reversed(depth):
            file.write(struct.pack("<%df" % WIDTH, *row))


def scene():
    """A slanted square on background."""
    covered = lambda x, y: 8 <= x < 40 and 6 <= y < 26
    depth = [[10 + 0.05 * x if covered(x, y) else INFINITY for x in range(WIDTH)] for y in range(HEIGHT)]
    colour = [[[100 + x, 120, 140] if covered(x, y) else [20, 20, 20] for x in range(WIDTH)] for y in range(HEIGHT)]
    return colour, depth


def write_folder(folder, change=None, fov=60.0, eye_x=0.0):
    os.makedirs(folder, exist_ok=True)
    for frame in range(FRAMES):
        colour, depth = scene()
        if change:
            change(frame, colour, depth)
        write_png("%s/frame_%05d.png" % (folder, frame), colour)
        write_pfm("%s/frame_%05d.pfm" % (folder, frame), depth)
    cameras = [{"eye": [eye_x, 0, frame], "target": [0, 0, -1], "up": [0, 1, 0]} for frame in range(FRAMES)]
    with open(folder + "/path.json", "w") as file:
        json.dump({"fov_y_deg": fov, "frames": cameras}, file)


class Test:
    def __init__(self, program, root):
        self.program, self.root, self.failures = program, root, 0
        write_folder(root + "/a")

    def run(self, *options):
        command = [self.program, "compare", self.root + "/a", self.root + "/b", *options]
        return subprocess.run(command, capture_output=True, text=True)

    def check(self, claim, holds, detail):
        print("%s %s" % ("ok  " if holds else "FAIL", claim))
        if not holds:
            self.failures += 1
            print("     " + str(detail))

    def compare(self, change=None, *options, **folder):
        shutil.rmtree(self.root + "/b", ignore_errors=True)
        write_folder(self.root + "/b", change, **folder)
        result = self.run("--json", *options)
        return result.returncode, json.loads(result.stdout) if result.stdout else None, result.stderr

    def test_equal(self):
        status, answer, error = self.compare()
        self.check("equal folders pass", status == 0 and answer["holds"] and answer["psnr_median_db"] == 100 and
                   answer["depth_within"] == 1 and answer["covered_in_both"] == FRAMES * 640, (status, answer, error))

    def test_coverage(self):
        def hole(frame, colour, depth):
            if frame == 1:
                depth[16][20] = INFINITY

        def speck(frame, colour, depth):
            if frame == 2:
                depth[2][3] = depth[30][3] = 11

        def edge(frame, colour, depth):
            for y in range(6, 26):
                depth[y][8], depth[y][41] = INFINITY, 12

        status, answer, error = self.compare(hole)
        self.check("one pixel of a hole is found", status == 1 and answer["uncovered_pixels"] == 1 and
                   answer["worst_coverage_frame"] == 1 and "coverage" in error, (status, answer, error))
        status, answer, error = self.compare(speck)
        self.check("pixels outside are found, at the image's edge too", status == 1 and
                   answer["overcovered_pixels"] == 2, (status, answer, error))
        status, answer, error = self.compare(edge)
        self.check("an outline that moves by one pixel is no hole", answer["uncovered_pixels"] == 0 and
                   answer["overcovered_pixels"] == 0, (status, answer, error))

    def test_depth(self):
        def moved(share):
            def change(frame, colour, depth):
                for y in range(6, 26):
                    for x in range(8, 40):
                        z = 10 + 0.05 * x
                        depth[y][x] = z + 0.05 + share * z / FOCAL if 8 < x < 39 else z
            return change

        def two(frame, colour, depth):
            depth[15][15] = depth[15][25] = 14

        status, answer, error = self.compare(moved(0.99))
        self.check("depth within a pixel's error passes", status == 0 and answer["depth_within"] == 1,
                   (status, answer, error))
        status, answer, error = self.compare(moved(1.01))
        self.check("depth beyond it fails", status == 1 and answer["depth_within"] < 0.1 and "depth" in error,
                   (status, answer, error))
        status, answer, error = self.compare(moved(1.99), "--error", "2")
        self.check("--error widens the range", status == 0, (status, answer, error))
        status, answer, error = self.compare(two)
        expected = 1 - 2 * FRAMES / (640 * FRAMES)
        self.check("the share counts pixels", abs(answer["depth_within"] - expected) < 1e-6 and status == 1,
                   (status, answer, error))

    def test_colour(self):
        def off(by):
            def change(frame, colour, depth):
                for y in range(HEIGHT):
                    for x in range(WIDTH):
                        if depth[y][x] < INFINITY:
                            colour[y][x] = [v + by for v in colour[y][x]]
                        else:
                            colour[y][x] = [200, 0, 0]  # background does not count
            return change

        status, answer, error = self.compare(off(5))
        expected = 20 * math.log10(255 / 5)
        self.check("PSNR is that of the covered pixels", status == 0 and
                   abs(answer["psnr_median_db"] - expected) < 1e-3, (answer, error))
        status, answer, error = self.compare(off(10))
        self.check("a PSNR below 30 dB fails", status == 1 and "PSNR" in error, (status, answer, error))
        status, answer, error = self.compare(off(10), "--psnr", "28")
        self.check("--psnr sets the limit", status == 0, (status, answer, error))

    def test_differing(self):
        """Of pixels covered in either: a frame has 640, and the background does not count."""
        def change(frame, colour, depth):
            colour[0][0] = [200, 0, 0]
            if frame == 1:
                colour[10][10], colour[11][11], colour[12][12] = ([v + by for v in colour[10][10]] for by in (1, 16, 17))
                depth[2][3] = 11  # covered here alone
                colour[2][3] = [255, 255, 255]

        status, answer, error = self.compare(change, "--psnr", "0")
        self.check("pixels that differ are counted, and those that do visibly", answer["differing_pixels"] == 4 and
                   answer["visibly_differing_pixels"] == 2 and answer["covered_in_either"] == FRAMES * 640 + 1, (answer, error))

    def test_refusals(self):
        status, answer, error = self.compare(None, eye_x=1e-9)
        self.check("other cameras are refused", status == 1 and "different cameras" in error, error)
        self.compare()
        os.remove(self.root + "/b/frame_00001.pfm")
        result = self.run()
        self.check("a missing depth file is named", result.returncode == 1 and "frame_00001.pfm" in result.stderr,
                   result.stderr)
        with open(self.root + "/b/frame_00001.pfm", "wb") as file:
            file.write(b"Pf\n48 32\n-1.0\n" + b"\0" * 100)
        result = self.run()
        self.check("a short depth file is refused", result.returncode == 1 and "bytes, expected" in result.stderr,
                   result.stderr)
        with open(self.root + "/b/frame_00000.png", "r+b") as file:
            file.truncate(60)
        result = self.run()
        self.check("a broken PNG is refused", result.returncode == 1 and "frame_00000.png" in result.stderr,
                   result.stderr)
        result = subprocess.run([self.program, "compare", self.root], capture_output=True, text=True)
        self.check("one folder is wrong usage", result.returncode == 2, result.stderr)


def main():
    with tempfile.TemporaryDirectory() as root:
        test = Test(os.path.abspath(sys.argv[1]), root)
        for part in (test.test_equal, test.test_coverage, test.test_depth, test.test_colour, test.test_differing,
                     test.test_refusals):
            part()
        return 1 if test.failures else 0


if __name__ == "__main__":
    sys.exit(main())
