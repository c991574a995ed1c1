"""Changes of a pair after which a good search finds the same map: the verdict should not depend on them."""
import hashlib
import math
import random

from surface import Surface


def write_obj(file, positions, triangles):
    text = "".join(f"v {x:.9g} {y:.9g} {z:.9g}\n" for x, y, z in positions)
    text += "".join(f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in triangles)
    part = file.with_suffix(".part")
    part.write_text(text)
    part.rename(file)


def turned(surface, draw):
    """The surface rotated at random, its vertices and triangles shuffled. Also the new number of each triangle."""
    q = [draw.gauss(0, 1) for _ in range(4)]
    w, x, y, z = (c / math.hypot(*q) for c in q)
    rows = ((1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
            (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
            (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)))
    vertices, triangles = (draw.sample(range(len(a)), len(a)) for a in (surface.positions, surface.triangles))
    number = {v: i for i, v in enumerate(vertices)}
    positions = [tuple(sum(a * b for a, b in zip(row, surface.positions[v])) for row in rows) for v in vertices]
    faces = [tuple(number[v] for v in surface.triangles[t]) for t in triangles]
    moved = {t: i for i, t in enumerate(triangles)}
    return positions, faces, lambda place: (moved[place[0]], place[1])


def refined(surface, _):
    """Each triangle cut into four at the middles of its edges: the triangle t becomes 4t to 4t + 3, the last is inside."""
    positions, middle, faces = list(surface.positions), {}, []

    def between(a, b):
        key = (min(a, b), max(a, b))
        if key not in middle:
            middle[key] = len(positions)
            positions.append(tuple((p + q) / 2 for p, q in zip(positions[a], positions[b])))
        return middle[key]

    for a, b, c in surface.triangles:
        ab, bc, ca = between(a, b), between(b, c), between(c, a)
        faces += [(a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca)]

    def move(place):
        t, w = place
        for k in range(3):  # near corner k
            if w[k] >= 0.5:
                return 4 * t + k, (2 * w[k] - 1, 2 * w[(k + 1) % 3], 2 * w[(k + 2) % 3])
        return 4 * t + 3, (w[0] + w[1] - w[2], w[1] + w[2] - w[0], w[2] + w[0] - w[1])

    return positions, faces, move


NOISE = 0.2  # standard deviation along each axis, in mean edges: as rough as a poor scan


def noisy(surface, draw):
    """The surface with its vertices moved at random."""
    edges = [math.dist(surface.positions[a], surface.positions[b]) for t in surface.triangles for a, b in zip(t, t[1:] + t[:1])]
    off = NOISE * sum(edges) / len(edges)
    return [tuple(draw.gauss(x, off) for x in p) for p in surface.positions], surface.triangles, lambda place: place


CHANGES = {"turned": turned, "refined": refined, "noisy": noisy}


def change(name, first, second, places, folder):
    """The surfaces and places of a pair after a change: "swapped", or one of the second surface."""
    if name == "swapped":
        return second, first, [(b, a, part) for a, b, part in places]
    if name in CHANGES:
        seed = hashlib.sha256(second.file.read_bytes()).hexdigest()
        file = folder / f"{second.file.stem}-{name}-{seed[:8]}.obj"
        positions, triangles, move = CHANGES[name](second, random.Random(seed))
        if not file.exists():
            folder.mkdir(parents=True, exist_ok=True)
            write_obj(file, positions, triangles)
        second, places = Surface(file), [(a, move(b), part) for a, b, part in places]
    return first, second, places
