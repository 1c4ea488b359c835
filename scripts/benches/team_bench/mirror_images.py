"""mirror: every log and every grid with its mirror image, under two namings; none is joined.

Logs are mirrored as text (carmen.mirrored) and mapped; grids have their rows flipped. Logs that have no text here (MRPT's) are mirrored as the grid
that was mapped of them.
"""
import itertools
import pathlib
import struct
import zlib

from benches import common
from benches.team_bench import carmen, inputs
from benches.team_bench.program import Failed

NAMINGS = (("a", "b"), ("o", "m"))   # the log, its mirror image: whichever name comes first
GRID_RESOLUTION_M = 0.02             # of Halmstad's grids: not stated; doors are as wide as doors then
RAWLOGS = ("malaga_sena_one_loop", "graphslam_simul", "localization_demo")


def grids():
    """Robots' maps; the buildings' layouts beside them are drawings."""
    return sorted((inputs.LASER / "mapmerge_halmstad").glob("*/*_[0-9]*.png"))


def read_grey_png(path):
    """Rows of an 8-bit PNG without palette or interlacing; colours become their mean, what is transparent is left as it is."""
    data, position, packed, header = path.read_bytes(), 8, b"", None
    while position < len(data):
        size, kind = struct.unpack(">I4s", data[position:position + 8])
        body = data[position + 8:position + 8 + size]
        if kind == b"IHDR":
            header = struct.unpack(">IIBBBBB", body)
        elif kind == b"IDAT":
            packed += body
        position += 12 + size
    width, height, depth, colour, _, _, interlaced = header
    channels = {0: 1, 2: 3, 4: 2, 6: 4}.get(colour)
    if depth != 8 or interlaced or not channels:
        common.give_up(f"{path} is no picture of 8 bits without palette and interlacing")
    stride = channels * width
    raw, rows, above = zlib.decompress(packed), [], bytes(stride)
    for y in range(height):
        kind, line = raw[y * (stride + 1)], bytearray(raw[y * (stride + 1) + 1:(y + 1) * (stride + 1)])
        for x in range(stride if kind else 0):
            left, upper, corner = line[x - channels] if x >= channels else 0, above[x], above[x - channels] if x >= channels else 0
            if kind == 4:
                estimate = left + upper - corner
                near = min((abs(estimate - left), 0, left), (abs(estimate - upper), 1, upper), (abs(estimate - corner), 2, corner))[2]
            else:
                near = {1: left, 2: upper, 3: (left + upper) // 2}[kind]
            line[x] = (line[x] + near) & 255
        above = bytes(line)
        colours = channels - 1 + channels % 2
        rows.append(above if channels == 1 else bytes(sum(above[x:x + colours]) // colours for x in range(0, stride, channels)))
    return rows


def read_pgm(path):
    words, position = [], 0
    data = path.read_bytes()
    while len(words) < 4:
        end = position
        while not data[end:end + 1].isspace():
            end += 1
        if data[position:position + 1] == b"#":
            end = data.index(b"\n", position)
        elif end > position:
            words.append(data[position:end])
        position = end + 1
    width, height = int(words[1]), int(words[2])
    return [data[position + y * width:position + (y + 1) * width] for y in range(height)]


def write_grid(folder, name, rows, resolution_m):
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{name}.pgm").write_bytes(b"P5\n%d %d\n255\n" % (len(rows[0]), len(rows)) + b"".join(rows))
    path = folder / f"{name}.yaml"
    path.write_text(f"image: {name}.pgm\nresolution: {resolution_m}\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n")
    return path


def of_log(bench, log, naming):
    """A log and its mirror image, mapped under these names."""
    plain, mirror = naming
    loaded = inputs.text(log, 1 if log in inputs.CORRECTED_LOGS else 0)

    def write(folder, name, what):
        folder.mkdir(parents=True, exist_ok=True)
        return [what(loaded).write(folder / f"{name}.log.gz")]
    key = f"mirror/{log}-{plain}{mirror}"
    one, _ = bench.store.made(f"{key}-plain", [plain], lambda folder: write(folder, plain, lambda log: log))
    other, _ = bench.store.made(f"{key}-mirror", [mirror], lambda folder: write(folder, mirror, carmen.mirrored))
    return [*one, *other]


def of_grid(bench, path, naming):
    plain, mirror = naming
    rows = read_grey_png(path)
    folder = bench.scratch("grids", f"{path.stem}-{plain}{mirror}")
    return [write_grid(folder, plain, rows, GRID_RESOLUTION_M), write_grid(folder, mirror, rows[::-1], GRID_RESOLUTION_M)]


def of_rawlog(bench, log, naming):
    plain, mirror = naming
    maps, _ = bench.store.made(f"mirror/{log}-{plain}", [plain], lambda folder: [inputs.LASER / f"mrpt/{log}.rawlog"])
    folder = bench.scratch("grids", f"{log}-{plain}{mirror}")
    bench.program("export", maps[0], "--out", folder / "own", "--pgm", "--force")
    pgm = next((folder / "own").rglob("map.pgm"))
    return [maps[0], write_grid(folder, mirror, read_pgm(pgm)[::-1], 0.05)]


def measure(bench, item):
    kind, what, naming = item
    name = f"{pathlib.Path(str(what)).stem}-{''.join(naming)}"
    maps = {"log": of_log, "grid": of_grid, "rawlog": of_rawlog}[kind](bench, what, naming)
    done, summary, merges = bench.merge(maps, bench.scratch(f"mirror-{name}"))
    if summary["team"]["components"] < 2:
        bench.picture(maps, f"mirror-{name}")
    verdict = merges[0] if merges else {"decision": "none", "reason": "none", "probability": 0.0}
    return {"kind": kind, "name": name, "joined": summary["team"]["components"] < 2, "decision": verdict["decision"], "reason": verdict["reason"],
            "probability": verdict["probability"], "cpu_s": done.cpu_s}


def run(bench):
    logs = bench.arguments.logs if bench.arguments.logs_chosen else [*bench.arguments.logs, *inputs.VISITS]
    things = [("log", log) for log in logs]
    if not bench.arguments.logs_chosen:
        things += [("rawlog", log) for log in RAWLOGS] + [("grid", path) for path in grids()]
    rows, failed = {}, 0
    for item, row in bench.side_by_side(lambda item: measure(bench, item), [(*thing, naming) for thing, naming in itertools.product(things, NAMINGS)]):
        if isinstance(row, Failed):
            print(f"mirror: {item[1]}: {row}", flush=True)
            failed += 1
            continue
        rows[row["name"]] = row
        print(f"mirror: {row['name']}: {'JOINED' if row['joined'] else 'apart'} ({row['decision']}, {row['reason']}, {row['probability']:.3f})", flush=True)
        bench.keep("mirror", {row["name"]: row})
    kept = bench.keep("mirror", rows).values()
    bench.table("mirror", "Logs and grids with their mirror images, under two namings each", ("what", "pairs", "joined"),
                [(label, len(some), sum(row["joined"] for row in some)) for kind, label in (("log", "log and mirrored log"), ("rawlog", "log and its mirrored grid"), ("grid", "grid and mirrored grid"))
                 if (some := [row for row in kept if row["kind"] == kind])])
    joined = sum(row["joined"] for row in rows.values())
    bench.gate("mirror", "joined with their mirror images", f"{joined} of {len(rows)}", "0", joined == 0 and len(rows) > 0)
    bench.gate("mirror", "runs that failed", failed, "0", failed == 0)
