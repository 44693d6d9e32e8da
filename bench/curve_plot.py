"""Error against triangles: interpolation between measured cuts, and the picture of it. Standard library only.

A curve is a list of cuts, dicts with `triangles`, `rms` and `max` (both as shares of the model's diagonal)."""
import math
from xml.sax.saxutils import escape

WIDTH, HEIGHT = 760, 520
LEFT, RIGHT, TOP, BOTTOM = 82, 20, 46, 64
OWN_COLOURS, PEER_COLOURS = ("#1f4fa4", "#22a5c9"), ("#d9480f", "#1a8a40", "#8e44ad")
MEASURES = (("rms", "root mean square", ""), ("max", "maximum", "6 4"))


def triangles_at(curve, measure, error):
    """How many triangles the curve needs for the error: on the line, in logarithms, between the first cut that reaches
    it and the next coarser one. None where no cut reaches it or all do."""
    cuts = sorted(curve, key=lambda cut: cut["triangles"])
    for coarse, fine in zip(cuts, cuts[1:]):
        if coarse[measure] > error >= fine[measure] and fine["triangles"] > coarse["triangles"]:
            span = math.log(coarse[measure]) - math.log(max(fine[measure], 1e-300))
            share = (math.log(coarse[measure]) - math.log(error)) / span
            return math.exp(math.log(coarse["triangles"]) + share * math.log(fine["triangles"] / coarse["triangles"]))
    return None


def round_errors(curves, measure, most=6):
    """Round errors that all curves have, at most so many, evenly among those there are."""
    errors = [step * 10.0**power for power in range(-8, 1) for step in (1, 1.5, 2, 3, 5, 7)]
    common = [error for error in errors if all(triangles_at(curve, measure, error) for curve in curves)]
    if len(common) <= most:
        return common
    return [common[round(i * (len(common) - 1) / (most - 1))] for i in range(most)]


class Axes:
    """From triangles and error to the picture, both in logarithms."""

    def __init__(self, cuts):
        triangles = [cut["triangles"] for cut in cuts]
        errors = [cut[measure] for cut in cuts for measure, _, _ in MEASURES]
        self.left, self.right = math.log10(min(triangles)) - 0.05, math.log10(max(triangles)) + 0.05
        self.low, self.high = math.log10(min(errors)) - 0.05, math.log10(max(errors)) + 0.05

    def x(self, triangles):
        return LEFT + (math.log10(triangles) - self.left) / (self.right - self.left) * (WIDTH - LEFT - RIGHT)

    def y(self, error):
        return HEIGHT - BOTTOM - (math.log10(error) - self.low) / (self.high - self.low) * (HEIGHT - TOP - BOTTOM)


def ticks(low, high, steps):
    """Those of the steps times powers of ten that lie between two logarithms."""
    values = [step * 10.0**power for power in range(math.floor(low), math.ceil(high) + 1) for step in steps]
    return [value for value in values if low <= math.log10(value) <= high]


def short_count(value):
    for unit, name in ((1e6, " M"), (1e3, " k")):
        if value >= unit:
            return f"{value / unit:g}{name}"
    return f"{value:g}"


def text(x, y, words, anchor="middle", more=""):
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}"{more}>{escape(words)}</text>'


def line(x1, y1, x2, y2, style):
    return f'<line x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}" {style}/>'


def grid(axes):
    light, dark = 'stroke="#dddddd"', 'stroke="#444444"'
    for triangles in ticks(axes.left, axes.right, (1, 2, 5)):
        x = axes.x(triangles)
        yield line(x, TOP, x, HEIGHT - BOTTOM, light)
        yield text(x, HEIGHT - BOTTOM + 18, short_count(triangles))
    for error in ticks(axes.low, axes.high, (1, 2, 5)):
        y = axes.y(error)
        yield line(LEFT, y, WIDTH - RIGHT, y, light)
        yield text(LEFT - 8, y + 4, f"{error:.0e}".replace("e-0", "e-"), "end")
    yield line(LEFT, HEIGHT - BOTTOM, WIDTH - RIGHT, HEIGHT - BOTTOM, dark)
    yield line(LEFT, TOP, LEFT, HEIGHT - BOTTOM, dark)
    yield text((LEFT + WIDTH - RIGHT) / 2, HEIGHT - 24, "triangles drawn")
    middle = (TOP + HEIGHT - BOTTOM) / 2
    yield text(18, middle, "measured distance / diagonal", more=f' transform="rotate(-90 18 {middle:.1f})"')


def curve_lines(axes, curve, colour):
    cuts = sorted(curve, key=lambda cut: cut["triangles"])
    for measure, _, dashes in MEASURES:
        places = [(axes.x(cut["triangles"]), axes.y(cut[measure])) for cut in cuts]
        path = " ".join(f"{x:.1f},{y:.1f}" for x, y in places)
        yield (f'<polyline points="{path}" fill="none" stroke="{colour}" stroke-width="1.8"'
               + (f' stroke-dasharray="{dashes}"' if dashes else "") + "/>")
        for x, y in places:
            yield f'<circle cx="{x:.1f}" cy="{y:.1f}" r="2.6" fill="{colour}"/>'


def colours_of(names):
    """name -> colour: cold ones for Stroll's curves, others for those of its peers."""
    left = {True: list(OWN_COLOURS), False: list(PEER_COLOURS)}
    colours = {}
    for name in names:
        choice = left[name.startswith("stroll")]
        colours[name] = choice.pop(0) if choice else "#777777"
    return colours


def legend(colours):
    """In the lower left, where no curve comes: errors fall with triangles."""
    rows = len(colours) + len(MEASURES)
    top = HEIGHT - BOTTOM - 12 - 18 * rows
    yield (f'<rect x="{LEFT + 10}" y="{top}" width="270" height="{18 * rows + 6}" fill="white" '
           'fill-opacity="0.9" stroke="#bbbbbb"/>')
    for i, (name, colour) in enumerate(colours.items()):
        y = top + 15 + 18 * i
        yield line(LEFT + 18, y - 4, LEFT + 46, y - 4, f'stroke="{colour}" stroke-width="3"')
        yield text(LEFT + 54, y, name, "start")
    for i, (_, name, dashes) in enumerate(MEASURES):
        y = top + 15 + 18 * (len(colours) + i)
        style = f'stroke="#444444" stroke-width="1.8" stroke-dasharray="{dashes or "none"}"'
        yield line(LEFT + 18, y - 4, LEFT + 46, y - 4, style)
        yield text(LEFT + 54, y, name, "start")


def draw(title, curves):
    """curves: name -> curve. The whole SVG file as text."""
    drawable = {name: [cut for cut in curve if cut["rms"] > 0 and cut["triangles"] > 0] for name, curve in curves.items()}
    axes = Axes([cut for curve in drawable.values() for cut in curve])
    parts = [f'<svg xmlns="http://www.w3.org/2000/svg" width="{WIDTH}" height="{HEIGHT}" viewBox="0 0 {WIDTH} {HEIGHT}" '
             'font-family="sans-serif" font-size="12">', f'<rect width="{WIDTH}" height="{HEIGHT}" fill="white"/>',
             text(WIDTH / 2, 26, title, more=' font-size="15"'), *grid(axes)]
    colours = colours_of(drawable)
    for name, curve in drawable.items():
        parts += curve_lines(axes, curve, colours[name])
    return "\n".join([*parts, *legend(colours), "</svg>"]) + "\n"
