"""Readers of what the program writes for other tools: strict, each from the format's own description, in Python's standard library."""
import math
import re
import struct
import zlib


class Refused(Exception):
    """What a strict reader of the format would not take."""


def expect(holds, what):
    if not holds:
        raise Refused(what)


def number(word):
    value = float(word)
    expect(math.isfinite(value), f"{word} is no number")
    return value


def read_tum(path):
    """[stamp x y z qx qy qz qw], stamps rising, unit quaternions."""
    rows = [[number(word) for word in line.split(" ")] for line in path.read_text().splitlines() if not line.startswith("#")]
    expect(rows, "no pose")
    for row in rows:
        expect(len(row) == 8, f"{len(row)} numbers in a line")
        expect(abs(math.hypot(*row[4:]) - 1.0) < 1e-5, "a quaternion that is not of length one")
    expect(all(one[0] < other[0] for one, other in zip(rows, rows[1:])), "stamps that do not rise")
    return rows


def read_png(path):
    """(columns, rows) of a PNG whose checksums and pixels are whole."""
    data, at, pixels, size = path.read_bytes(), 8, b"", None
    expect(data[:8] == b"\x89PNG\r\n\x1a\n", "no PNG")
    while at < len(data):
        length, kind = struct.unpack_from(">I4s", data, at)
        body = data[at + 8:at + 8 + length]
        expect(zlib.crc32(kind + body) == struct.unpack_from(">I", data, at + 8 + length)[0], "a checksum")
        if kind == b"IHDR":
            columns, rows, depth, colour = struct.unpack_from(">IIBB", body)
            size, stride = (columns, rows), 1 + math.ceil(columns * depth * {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}[colour] / 8)
        if kind == b"IDAT":
            pixels += body
        at += 12 + length
    expect(kind == b"IEND" and at == len(data), "no end")
    expect(len(zlib.decompress(pixels)) == size[1] * stride, "pixels that are missing")
    return size


class Grid:
    """map.yaml and its PGM as map_server loads them: 0 is a wall, 254 is free, 205 unknown; y grows upwards."""

    KEYS = {"image", "mode", "resolution", "origin", "negate", "occupied_thresh", "free_thresh"}
    OF_MAPWEAVE = {"map_id", "map_version", "content_hash"}

    def __init__(self, path):
        self.keys = {}
        for line in path.read_text().splitlines():
            key, value = line.split(": ", 1)
            expect(key not in self.keys, f"{key} twice")
            self.keys[key] = value.strip('"')
        expect(self.KEYS <= set(self.keys) <= self.KEYS | self.OF_MAPWEAVE, f"keys {sorted(self.keys)}")
        self.resolution_m = number(self.keys["resolution"])
        origin = re.fullmatch(r"\[(\S+), (\S+), (\S+)\]", self.keys["origin"])
        self.x_m, self.y_m, yaw = map(number, origin.groups())
        expect(yaw == 0.0, "a turned grid")
        data = (path.parent / self.keys["image"]).read_bytes()
        header = re.match(rb"P5\s(?:#[^\n]*\n)*(\d+)\s+(\d+)\s+255\s", data)
        expect(header, "no PGM of 8 bits")
        self.columns, self.rows = map(int, header.groups())
        self.cells = data[header.end():]
        expect(len(self.cells) == self.columns * self.rows, "cells that are missing, or more than there are")
        expect(set(self.cells) <= {0, 205, 254}, "cells of no known kind")

    def is_wall(self, x_m, y_m, within=0):
        column, row = int((x_m - self.x_m) // self.resolution_m), self.rows - 1 - int((y_m - self.y_m) // self.resolution_m)
        near = range(-within, within + 1)
        return any(0 <= column + i < self.columns and 0 <= row + j < self.rows and self.cells[(row + j) * self.columns + column + i] == 0
                   for i in near for j in near)

    def walls(self):
        """The middles of all wall cells, in metres."""
        return [(self.x_m + (i % self.columns + 0.5) * self.resolution_m, self.y_m + (self.rows - 0.5 - i // self.columns) * self.resolution_m)
                for i, cell in enumerate(self.cells) if cell == 0]


def read_pcd(path):
    """[(x, y, z)] of a PCD v0.7 of four floats, the fourth a packed colour."""
    head, mark, body = path.read_bytes().partition(b"DATA binary\n")
    expect(mark, "no binary PCD")
    lines = [line.split() for line in head.decode("ascii").splitlines() if not line.startswith("#")]
    keys = {line[0]: line[1:] for line in lines}
    expect([line[0] for line in lines] == ["VERSION", "FIELDS", "SIZE", "TYPE", "COUNT", "WIDTH", "HEIGHT", "VIEWPOINT", "POINTS"], "the header's order")
    expect((keys["FIELDS"], keys["SIZE"], keys["TYPE"], keys["COUNT"]) == (["x", "y", "z", "rgb"], ["4"] * 4, ["F"] * 4, ["1"] * 4), "fields")
    points = int(keys["POINTS"][0])
    expect(points == int(keys["WIDTH"][0]) * int(keys["HEIGHT"][0]) and len(body) == 16 * points, "points that are missing, or more than there are")
    return finite([point[:3] for point in struct.iter_unpack("<ffff", body)])


def read_ply(path):
    """[(x, y, z)] of a PLY of coloured points."""
    head, mark, body = path.read_bytes().partition(b"end_header\n")
    lines = [line for line in head.decode("ascii").splitlines() if not line.startswith("comment")]
    expect(mark and lines[:2] == ["ply", "format binary_little_endian 1.0"], "no binary PLY")
    count = int(re.fullmatch(r"element vertex (\d+)", lines[2]).group(1))
    expect(lines[3:] == [f"property float {axis}" for axis in "xyz"] + [f"property uchar {name}" for name in ("red", "green", "blue")], "properties")
    expect(len(body) == 15 * count, "points that are missing, or more than there are")
    return finite([point[:3] for point in struct.iter_unpack("<fffBBB", body)])


def finite(points):
    expect(points and all(math.isfinite(value) for point in points for value in point), "no points, or such that are nowhere")
    return points


G2O_NUMBERS = {"VERTEX_SE2": 3, "VERTEX_SE3:QUAT": 7, "VERTEX_TRACKXYZ": 3, "PARAMS_CAMERACALIB": 11, "EDGE_SE2": 3 + 6, "EDGE_SE3:QUAT": 7 + 21,
               "EDGE_PROJECT_DISPARITY": 3 + 6, "FIX": 0}
G2O_IDS = {"EDGE_SE2": 2, "EDGE_SE3:QUAT": 2, "EDGE_PROJECT_DISPARITY": 3}


def read_g2o(path):
    """(vertices by id, edges): all ids known before they are used, all numbers there, one connected graph that is held in one place."""
    vertices, edges, cameras, fixed = {}, [], set(), []
    for line in path.read_text().splitlines():
        if line.startswith("#"):
            continue
        tag, *words = line.split(" ")
        expect(tag in G2O_NUMBERS, f"g2o has no {tag}")
        ids = [int(word) for word in words[:G2O_IDS.get(tag, 1)]]
        numbers = [number(word) for word in words[len(ids):]]
        expect(len(numbers) == G2O_NUMBERS[tag], f"{len(numbers)} numbers of a {tag}")
        if tag.startswith("VERTEX"):
            expect(ids[0] not in vertices, f"vertex {ids[0]} twice")
            vertices[ids[0]] = (tag, numbers)
        elif tag.startswith("EDGE"):
            expect(all(one in vertices for one in ids[:2]), "an edge of a vertex that is not there")
            expect(len(ids) < 3 or ids[2] in cameras, "an edge of a camera that is not there")
            edges.append((tag, ids, numbers))
        elif tag == "FIX":
            fixed += ids
        else:
            cameras.add(ids[0])
    expect(fixed and set(fixed) <= set(vertices), "nothing holds it")
    reached, known = set(), {one: [] for one in vertices}
    for _, (one, other, *_), _ in edges:
        known[one].append(other)
        known[other].append(one)
    ahead = list(fixed)
    while ahead:
        one = ahead.pop()
        if one not in reached:
            reached.add(one)
            ahead += known[one]
    expect(reached == set(vertices), f"{len(vertices) - len(reached)} vertices that nothing holds")
    return vertices, edges


def read_octomap(path):
    """(resolution in metres, nodes) of a .bt or .ot whose tree ends where the file ends, with as many nodes as it says."""
    data = path.read_bytes()
    head, mark, body = data.partition(b"\ndata\n")
    lines = [line for line in head.decode("ascii").splitlines() if not line.startswith("#")]
    keys = dict(line.split(" ", 1) for line in lines)
    whole = path.suffix == ".ot"
    expect(mark and data.startswith(b"# Octomap OcTree file\n" if whole else b"# Octomap OcTree binary file\n"), "no OctoMap")
    expect(keys["id"] == ("ColorOcTree" if whole else "OcTree"), f"a tree of kind {keys['id']}")
    nodes, at = (full_nodes if whole else binary_nodes)(body)
    expect((nodes, at) == (int(keys["size"]), len(body)), f"{nodes} nodes in {at} bytes, not {keys['size']} in {len(body)}")
    return number(keys["res"]), nodes


def full_nodes(body):
    """Of a .ot: log odds, colour, and a byte that says which children follow."""
    nodes, at, ahead = 0, 0, 1
    while ahead:
        expect(math.isfinite(struct.unpack_from("<f", body, at)[0]), "log odds that are no number")
        ahead += body[at + 7].bit_count() - 1
        nodes, at = nodes + 1, at + 8
    return nodes, at


def binary_nodes(body):
    """Of a .bt: two bits for each child: unknown, free, occupied, or one with children of its own."""
    nodes, at, ahead = 1, 0, 1
    while ahead:
        children = int.from_bytes(body[at:at + 2], "little")
        kinds = [children >> shift & 3 for shift in range(0, 16, 2)]
        nodes, at, ahead = nodes + sum(kind != 0 for kind in kinds), at + 2, ahead - 1 + kinds.count(3)
    return nodes, at
