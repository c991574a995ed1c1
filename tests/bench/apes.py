"""People with the proportions of an ape, for the set `apes` of tests/bench/correspond.py. Standard library only.

Each body of ../shared/meshes/posed is one, in its pose: the arms are longer, the legs shorter, the torso larger. Triangles
stay, and so do the places of the truth. Parts are told by the samples nearest along the surface, and blend at joints.
"""
import csv
import heapq
import random

from surface import Surface

SCALES = {"arm": 1.4, "hand": 1.4, "leg": 0.62, "foot": 0.62, "head": 0.95, "neck": 0.95}
TORSO = 1.2
ROUNDS = 60  # of averages over neighbours, by which parts blend
SEED = 5
CHOSEN_ON = 3  # constants of branches.h were chosen on each third pair


def pairs(files):
    """Each body as an ape, with two bodies of other people."""
    draw, files = random.Random(SEED), sorted(files)
    rows = []
    for file in files:
        others = [other for other in files if other.split("-")[0] != file.split("-")[0]]
        rows += [(f"ape-{file.rsplit('.', 1)[0]}.obj", other, "ape") for other in draw.sample(others, 2)]
    return rows


def limb_of(part):
    """The name of a limb, or `torso`."""
    name, side = (part.split(".") + [""])[:2]
    return "torso" if name not in SCALES else {"hand": "arm", "foot": "leg", "neck": "head"}.get(name, name) + side


def nearest_limbs(surface, sources):
    """The limb of each vertex: that of the source nearest along the edges. sources: vertices and their limbs."""
    surface.link_vertices()
    limb, queue = {}, [(0.0, vertex, name) for vertex, name in sources]
    heapq.heapify(queue)
    while queue:
        far, vertex, name = heapq.heappop(queue)
        if vertex not in limb:
            limb[vertex] = name
            for other, length in surface.links[vertex]:
                if other not in limb:
                    heapq.heappush(queue, (far + length, other, name))
    return limb


def neighbours_of(surface):
    out = [set() for _ in surface.positions]
    for a, b, c in surface.triangles:
        out[a] |= {b, c}
        out[b] |= {a, c}
        out[c] |= {a, b}
    return out


def blend(values, neighbours):
    for _ in range(ROUNDS):
        values = [0.5 * x + 0.5 * sum(values[u] for u in near) / len(near) for x, near in zip(values, neighbours)]
    return values


def centre(positions, weights):
    total = sum(weights)
    return tuple(sum(w * p[k] for w, p in zip(weights, positions)) / total for k in range(3))


def ape_of(file, truth, parts):
    """The positions and triangles of a body as an ape. truth: the places of the samples; parts: their names."""
    surface = Surface(file)
    positions = surface.positions
    sources = []
    for sample, (triangle, weights) in truth.items():
        corner = max(range(3), key=lambda k, weights=weights: weights[k])
        sources.append((surface.triangles[triangle][corner], limb_of(parts[sample])))
    limb, neighbours = nearest_limbs(surface, sources), neighbours_of(surface)
    share = {name: blend([float(limb[v] == name) for v in range(len(positions))], neighbours)
             for name in sorted(set(limb.values()))}
    middle = centre(positions, share["torso"])
    moved = [(0.0, 0.0, 0.0)] * len(positions)
    for name, own in share.items():
        joint = middle if name == "torso" else centre(positions, [x * y for x, y in zip(own, share["torso"])])
        scale = TORSO if name == "torso" else SCALES[name.rstrip("LR")]
        moved = [tuple(m[k] + w * (middle[k] + TORSO * (joint[k] - middle[k]) + scale * (p[k] - joint[k])) for k in range(3))
                 for m, w, p in zip(moved, own, positions)]
    return moved, surface.triangles


def write_ape(file, truth, samples, out):
    with samples.open() as rows:
        parts = {int(row["sample"]): row["part"] for row in csv.DictReader(rows)}
    positions, triangles = ape_of(file, truth, parts)
    lines = [f"v {x:.7g} {y:.7g} {z:.7g}" for x, y, z in positions]
    lines += ["f " + " ".join(str(v + 1) for v in corners) for corners in triangles]
    out.write_text("\n".join(lines) + "\n")
