"""Plots of lines as PNG, in Python's standard library alone."""
import math
import struct
import zlib

# Letters of 3 x 5 points, rows from the top, three bits each.
FONT = {"0": 0o75557, "1": 0o26227, "2": 0o71747, "3": 0o71717, "4": 0o55711, "5": 0o74717, "6": 0o74757, "7": 0o71122, "8": 0o75757, "9": 0o75717,
        "A": 0o25755, "B": 0o65656, "C": 0o34443, "D": 0o65556, "E": 0o74647, "F": 0o74644, "G": 0o34553, "H": 0o55755, "I": 0o72227, "J": 0o11152,
        "K": 0o55655, "L": 0o44447, "M": 0o57755, "N": 0o65555, "O": 0o25552, "P": 0o65644, "Q": 0o25563, "R": 0o65655, "S": 0o34216, "T": 0o72222,
        "U": 0o55557, "V": 0o55552, "W": 0o55775, "X": 0o55255, "Y": 0o55222, "Z": 0o71247, ".": 0o00002, ",": 0o00024, "-": 0o00700, "%": 0o51245,
        "/": 0o11244, ":": 0o02020, "(": 0o24442, ")": 0o21112}
COLOURS = ((31, 119, 180), (214, 39, 40), (44, 160, 44), (255, 127, 14), (148, 103, 189), (110, 110, 110), (23, 190, 207))


class Picture:
    def __init__(self, width, height):
        self.width, self.height = width, height
        self.rows = [bytearray(b"\xff" * 3 * width) for _ in range(height)]

    def point(self, x, y, colour):
        if 0 <= x < self.width and 0 <= y < self.height:
            self.rows[y][3 * x:3 * x + 3] = bytes(colour)

    def line(self, a, b, colour, wide=1):
        steps = max(1, int(max(abs(b[0] - a[0]), abs(b[1] - a[1]))))
        for i in range(steps + 1):
            x, y = (round(p + (q - p) * i / steps) for p, q in zip(a, b))
            for dx in range(wide):
                for dy in range(wide):
                    self.point(x + dx, y + dy, colour)

    def text(self, x, y, words, colour=(0, 0, 0), scale=2):
        for letter in words.upper():
            bits = FONT.get(letter, 0)
            for i in range(15):
                if bits >> (14 - i) & 1:
                    for k in range(scale * scale):
                        self.point(x + i % 3 * scale + k % scale, y + i // 3 * scale + k // scale, colour)
            x += 4 * scale

    def write(self, path):
        def chunk(kind, data):
            return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        rows = b"".join(b"\0" + bytes(row) for row in self.rows)
        path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", self.width, self.height, 8, 2, 0, 0, 0)) +
                         chunk(b"IDAT", zlib.compress(rows, 9)) + chunk(b"IEND", b""))


def ticks(low, high, logarithmic):
    if logarithmic:
        factors = (1, 2, 5) if high < 300 * low else (1,)
        return [factor * 10.0 ** i for i in range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1) for factor in factors
                if 0.99 * low <= factor * 10.0 ** i <= 1.01 * high]
    step = 10.0 ** math.floor(math.log10((high - low) / 3))
    step *= next(factor for factor in (1, 2, 5, 10) if (high - low) / (step * factor) <= 6)
    return [i * step for i in range(math.ceil(low / step), math.floor(high / step) + 1)]


def figure(name, title, x_name, y_name, series, log_y=False):
    """What a bench keeps of a figure, for lines() and for report.html. `series`: {name: [(x, y), ...]}."""
    return {"name": name, "title": title, "x": x_name, "y": y_name, "series": series, "log_y": log_y}


def draw(folder, figures):
    for one in figures:
        lines(folder / f"{one['name']}.png", one["title"], one["x"], one["y"], one["series"], one["log_y"])


def lines(path, title, x_name, y_name, series, log_y=False):
    """`series`: {name: [(x, y), ...]}; x is logarithmic where it spans more than a decade, and does not begin at 0."""
    picture, left, right, top, bottom = Picture(760, 460), 90, 20, 60, 60
    points = [point for some in series.values() for point in some if not log_y or point[1] > 0]
    x_low, x_high = min(x for x, _ in points), max(x for x, _ in points)
    y_low, y_high = min(y for _, y in points), max(y for _, y in points)
    if not log_y:
        y_low = min(0.0, y_low)
    y_high, x_high = max(y_high, y_low + 1e-9), max(x_high, x_low + 1e-9)
    log_x = x_high > 10 * x_low > 0

    def share(value, low, high, logarithmic):
        return math.log(value / low) / max(1e-9, math.log(high / low)) if logarithmic else (value - low) / (high - low)

    def place(x, y):
        return (left + (picture.width - left - right) * share(x, x_low, x_high, log_x),
                picture.height - bottom - (picture.height - top - bottom) * share(y, y_low, y_high, log_y))
    for value in ticks(x_low, x_high, log_x):
        at = place(value, y_low)
        picture.line((at[0], top), (at[0], picture.height - bottom), (225, 225, 225))
        picture.text(round(at[0]) - 10, picture.height - bottom + 8, f"{value:g}")
    for value in ticks(y_low, y_high, log_y):
        at = place(x_low, value)
        picture.line((left, at[1]), (picture.width - right, at[1]), (225, 225, 225))
        picture.text(20, round(at[1]) - 5, f"{value:g}")
    picture.line((left, top), (left, picture.height - bottom), (0, 0, 0))
    picture.line((left, picture.height - bottom), (picture.width - right, picture.height - bottom), (0, 0, 0))
    picture.text(left, 10, title)
    picture.text(picture.width - 8 * len(x_name) - right, picture.height - 24, x_name)
    picture.text(10, 42, y_name)
    for i, (name, some) in enumerate(series.items()):
        colour, placed = COLOURS[i % len(COLOURS)], [place(*point) for point in sorted(some) if not log_y or point[1] > 0]
        for a, b in zip(placed, placed[1:]):
            picture.line(a, b, colour, 2)
        for x, y in placed:
            for d in range(-2, 4):
                picture.line((x - 2, y + d), (x + 3, y + d), colour)
    legend(picture, left + 16, series, COLOURS)
    picture.write(path)


def legend(picture, left, names, colours):
    """Each name in its colour, one after the other, in as many lines as it takes."""
    x, y = left, 28
    for i, name in enumerate(names):
        if x > left and x + 8 * len(name) > picture.width - 10:
            x, y = left, y + 14
        picture.text(x, y, name, colours[i % len(colours)])
        x += 8 * len(name) + 24


def paths(path, title, series):
    """Trajectories in the plane, in metres, one scale for both axes. `series`: {name: [(x, y), ...]} in order; the first is drawn below the others, grey."""
    picture, margin, top = Picture(760, 620), 60, 60
    points = [point for some in series.values() for point in some]
    x_low, y_low = min(x for x, _ in points), min(y for _, y in points)
    x_high, y_high = max(x for x, _ in points), max(y for _, y in points)
    scale = min((picture.width - 2 * margin) / max(1e-9, x_high - x_low), (picture.height - top - margin - 20) / max(1e-9, y_high - y_low))

    def place(point):
        return margin + scale * (point[0] - x_low), picture.height - margin - scale * (point[1] - y_low)
    for value in ticks(x_low, max(x_high, x_low + 1e-6), False):
        at = place((value, y_low))
        picture.line((at[0], top), (at[0], picture.height - margin), (232, 232, 232))
        picture.text(round(at[0]) - 8, picture.height - margin + 8, f"{value:g}")
    for value in ticks(y_low, max(y_high, y_low + 1e-6), False):
        at = place((x_low, value))
        picture.line((margin, at[1]), (picture.width - margin, at[1]), (232, 232, 232))
        picture.text(10, round(at[1]) - 5, f"{value:g}")
    picture.text(margin, 10, title)
    picture.text(picture.width - margin - 8, picture.height - 24, "m")
    for i, (name, some) in enumerate(series.items()):
        colour, wide = ((170, 170, 170), 5) if i == 0 else (COLOURS[i - 1], 2)
        placed = [place(point) for point in some]
        for a, b in zip(placed, placed[1:]):
            if math.dist(a, b) < 40 or len(placed) < 10:   # not over what it did not see
                picture.line((a[0] - wide / 2, a[1] - wide / 2), (b[0] - wide / 2, b[1] - wide / 2), colour, wide)
    legend(picture, margin + 16, series, ((170, 170, 170), *COLOURS))
    picture.write(path)
