"""Small plots as SVG text: lines, bars and shares, with axes of round numbers."""
import math
from html import escape

WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM = 640, 320, 70, 20, 20, 50
COLORS = ("#1b6ca8", "#c8553d", "#3c8d53", "#7d5ba6")


def ticks(low, high, count=5):
    step = 10 ** math.floor(math.log10((high - low) / count)) if high > low else 1
    step *= next(f for f in (1, 2, 5, 10) if (high - low) / (step * f) <= count + 1)
    first = math.ceil(low / step)
    return [step * i for i in range(first, math.floor(high / step + 1e-9) + 1)]


def number(value):
    return f"{value / 1e6:g}M" if abs(value) >= 1e6 else f"{value / 1e3:g}k" if abs(value) >= 1e4 else f"{value:g}"


def frame(body, x_range, y_range, x_name, y_name):
    def px(x):
        return LEFT + (x - x_range[0]) / (x_range[1] - x_range[0] or 1) * (WIDTH - LEFT - RIGHT)

    def py(y):
        return HEIGHT - BOTTOM - (y - y_range[0]) / (y_range[1] - y_range[0] or 1) * (HEIGHT - TOP - BOTTOM)

    parts = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" font-family="sans-serif" '
             f'font-size="12"><rect width="{WIDTH}" height="{HEIGHT}" fill="#fff"/>']
    for x in ticks(*x_range):
        parts.append(f'<text x="{px(x):.1f}" y="{HEIGHT - BOTTOM + 16}" text-anchor="middle">{number(x)}</text>')
    for y in ticks(*y_range):
        parts.append(f'<path d="M{LEFT} {py(y):.1f}H{WIDTH - RIGHT}" stroke="#ddd"/>'
                     f'<text x="{LEFT - 6}" y="{py(y) + 4:.1f}" text-anchor="end">{number(y)}</text>')
    parts += body(px, py)
    parts.append(f'<text x="{WIDTH / 2}" y="{HEIGHT - 10}" text-anchor="middle">{escape(x_name)}</text>'
                 f'<text transform="translate(16 {HEIGHT / 2}) rotate(-90)" text-anchor="middle">{escape(y_name)}</text></svg>\n')
    return "\n".join(parts)


def lines(series, x_name, y_name):
    """Each of series is (name, [(x, y)…])."""
    xs, ys = ([p[k] for _, points in series for p in points] for k in (0, 1))

    def body(px, py):
        for i, (name, points) in enumerate(series):
            path = "L".join(f"{px(x):.1f} {py(y):.1f}" for x, y in points)
            yield f'<path d="M{path}" fill="none" stroke="{COLORS[i]}" stroke-width="2"/>'
            yield f'<text x="{LEFT + 10}" y="{TOP + 14 + 16 * i}" fill="{COLORS[i]}">{escape(name)}</text>'

    return frame(body, (min(0, *xs), max(xs)), (min(0, *ys), max(ys) * 1.05 or 1), x_name, y_name)


def bars(edges, counts, x_name, y_name):
    def body(px, py):
        for low, high, count in zip(edges, edges[1:], counts):
            yield (f'<rect x="{px(low):.1f}" y="{py(count):.1f}" width="{max(0.5, px(high) - px(low) - 0.5):.1f}" '
                   f'height="{py(0) - py(count):.1f}" fill="{COLORS[0]}"/>')

    return frame(body, (edges[0], edges[-1]), (0, max(counts) * 1.05 or 1), x_name, y_name)


def shares(series, x_name, y_name):
    """Expected shares against measured ones, both from 0 to 1, with the diagonal on which they are equal. Each of series
    is (name, [(expected, measured, (lowest, highest), number)…]). The numbers of the first series stand at the
    right of its points, those of the second at the left, so that neither hides the other."""
    def body(px, py):
        yield (f'<path d="M{px(0):.1f} {py(0):.1f}L{px(1):.1f} {py(1):.1f}" stroke="#888" stroke-dasharray="5 4"/>'
               f'<text x="{px(0.55):.1f}" y="{py(0.55) + 24:.1f}" fill="#666">as predicted</text>')
        for i, (name, points) in enumerate(series):
            color, fill = COLORS[i], "#fff" if i else COLORS[i]
            yield f'<text x="{LEFT + 10}" y="{TOP + 14 + 16 * i}" fill="{color}">{escape(name)}</text>'
            for x, y, (low, high), count in points:
                place = f'x="{px(x) - 7:.1f}" y="{py(low) + 10:.1f}" text-anchor="end"' if i else \
                    f'x="{px(x) + 7:.1f}" y="{py(high) + 4:.1f}"'
                yield (f'<path d="M{px(x):.1f} {py(low):.1f}V{py(high):.1f}" stroke="{color}" stroke-width="{2 - i}"/>'
                       f'<circle cx="{px(x):.1f}" cy="{py(y):.1f}" r="{4 + i}" fill="{fill}" fill-opacity="{1 - i}" '
                       f'stroke="{color}" stroke-width="2"/>'
                       f'<text {place} fill="{color}">{count}</text>')

    return frame(body, (0, 1), (0, 1.08), x_name, y_name)
