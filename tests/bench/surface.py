"""A triangle mesh with lengths along its surface, for the measurements of maps. Standard library only.

Lengths are those of shortest paths over edges and across pairs of triangles. They are never too short, and up to a few
percent too long.
"""
import heapq
import math
import threading


def minus(p, q):
    return (p[0] - q[0], p[1] - q[1], p[2] - q[2])


def dot(p, q):
    return p[0] * q[0] + p[1] * q[1] + p[2] * q[2]


def cross(p, q):
    return (p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0])


def read_mesh(file):
    """Positions and triangles of an OBJ or OFF file. Polygons become fans."""
    lines = [line.split() for line in file.read_text().splitlines() if line.strip() and line[0] != "#"]
    if file.suffix == ".off":
        counts, start = (lines[0][1:], 1) if len(lines[0]) > 1 else (lines[1], 2)
        vertices, polygons = int(counts[0]), int(counts[1])
        positions = [tuple(map(float, row[:3])) for row in lines[start:start + vertices]]
        faces = [list(map(int, row[1:1 + int(row[0])])) for row in lines[start + vertices:start + vertices + polygons]]
    else:
        positions = [tuple(map(float, row[1:4])) for row in lines if row[0] == "v"]
        faces = [[int(x.split("/")[0]) - 1 for x in row[1:]] for row in lines if row[0] == "f"]
    return positions, [(f[0], f[i], f[i + 1]) for f in faces for i in range(1, len(f) - 1)]


def closest(p, a, b, c):
    """The point of a triangle nearest to p (Ericson, Real-Time Collision Detection, 5.1.5)."""
    ab, ac, ap = minus(b, a), minus(c, a), minus(p, a)
    d1, d2 = dot(ab, ap), dot(ac, ap)
    bp, cp = minus(p, b), minus(p, c)
    d3, d4, d5, d6 = dot(ab, bp), dot(ac, bp), dot(ab, cp), dot(ac, cp)
    va, vb, vc = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
    if d1 <= 0 and d2 <= 0:
        v, w = 0, 0
    elif d3 >= 0 and d4 <= d3:
        v, w = 1, 0
    elif d6 >= 0 and d5 <= d6:
        v, w = 0, 1
    elif vc <= 0 <= d1 and d3 <= 0:
        v, w = d1 / (d1 - d3), 0
    elif vb <= 0 <= d2 and d6 <= 0:
        v, w = 0, d2 / (d2 - d6)
    elif va <= 0 and d4 >= d3 and d5 >= d6:
        w = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        v = 1 - w
    else:
        v, w = vb / (va + vb + vc), vc / (va + vb + vc)
    return tuple(a[k] + v * ab[k] + w * ac[k] for k in range(3))


class Surface:
    """A mesh of a file. A place is a triangle and three weights."""

    def __init__(self, file):
        self.file = file
        self.positions, self.triangles = read_mesh(file)
        corners = [[self.positions[v] for v in t] for t in self.triangles]
        self.area = sum(math.hypot(*cross(minus(b, a), minus(c, a))) / 2 for a, b, c in corners)
        low, high = (tuple(f(p[k] for p in self.positions) for k in range(3)) for f in (min, max))
        self.diagonal = math.dist(low, high)
        self.links = None
        self.linking = threading.Lock()

    def link_vertices(self):
        self.links = [[] for _ in self.positions]
        opposite = {}
        for a, b, c in self.triangles:
            opposite[a, b], opposite[b, c], opposite[c, a] = c, a, b
        for (a, b), c in opposite.items():
            self.links[a].append((b, math.dist(self.positions[a], self.positions[b])))
            length = self.across(a, b, c, opposite[b, a]) if (b, a) in opposite else None
            if length:
                self.links[c].append((opposite[b, a], length))
        self.fill_cells()

    def across(self, a, b, c, d):
        """The straight way from c to d over edge a–b, both triangles in one plane; None where it misses the edge."""
        edge, u, w = (minus(self.positions[v], self.positions[a]) for v in (b, c, d))
        length = math.hypot(*edge)
        if length == 0:
            return None
        cx, dx = dot(u, edge) / length, dot(w, edge) / length
        cy, dy = (math.sqrt(max(0, dot(p, p) - x * x)) for p, x in ((u, cx), (w, dx)))
        at = (cx * dy + dx * cy) / (cy + dy) if cy + dy else -1
        return math.hypot(cx - dx, cy + dy) if 0 < at < length else None

    def cell(self, p):
        return tuple(math.floor(x / self.size) for x in p)

    def fill_cells(self):
        self.size, self.cells = self.diagonal / 60, {}
        for t, corners in enumerate(self.triangles):
            ends = [self.cell(f(self.positions[v][k] for v in corners) for k in range(3)) for f in (min, max)]
            for x in range(ends[0][0], ends[1][0] + 1):
                for y in range(ends[0][1], ends[1][1] + 1):
                    for z in range(ends[0][2], ends[1][2] + 1):
                        self.cells.setdefault((x, y, z), []).append(t)

    def triangle_at(self, p):
        """The triangle that p lies on, p being on the surface but for rounding."""
        x, y, z = self.cell(p)
        near = {t for i in (-1, 0, 1) for j in (-1, 0, 1) for k in (-1, 0, 1)
                for t in self.cells.get((x + i, y + j, z + k), ())} or range(len(self.triangles))
        return min(near, key=lambda t: math.dist(p, closest(p, *(self.positions[v] for v in self.triangles[t]))))

    def position(self, place):
        corners = [self.positions[v] for v in self.triangles[place[0]]]
        return tuple(sum(w * corner[k] for w, corner in zip(place[1], corners)) for k in range(3))

    def length(self, place, image):
        """The length of the way from a place to a point of the surface: A*, the straight line being the bound."""
        with self.linking:  # several maps onto one surface are measured together
            if self.links is None:
                self.link_vertices()
        start, end = self.position(place), self.triangle_at(image)
        if set(self.triangles[place[0]]) & set(self.triangles[end]):
            return math.dist(start, image)
        last = {v: math.dist(self.positions[v], image) for v in self.triangles[end]}
        best, done, length = math.inf, set(), {}
        heap = []
        for v in self.triangles[place[0]]:
            length[v] = math.dist(start, self.positions[v])
            heapq.heappush(heap, (length[v] + math.dist(self.positions[v], image), v))
        while heap and heap[0][0] < best:
            v = heapq.heappop(heap)[1]
            if v in done:
                continue
            done.add(v)
            best = min(best, length[v] + last.get(v, math.inf))
            for u, step in self.links[v]:
                if length[v] + step < length.get(u, math.inf):
                    length[u] = length[v] + step
                    heapq.heappush(heap, (length[u] + math.dist(self.positions[u], image), u))
        return best if best < math.inf else math.dist(start, image)
