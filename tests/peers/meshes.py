#!/usr/bin/env python3
"""Compares our readers of mesh files with independent ones (trimesh, pycollada), facet by facet.

    meshes.py FACETS_PROGRAM

Seeded files of every kind are written: STL (binary, binary with a header that begins with `solid`, ASCII with one and several
solids, in capitals, with a byte order mark, with CRLF), OBJ (objects, groups, polygons, negative indices, texture and normal
indices, continued lines), COLLADA (nested nodes, matrices, several instances, every kind of polygon, units). Both sides read all
of them. Each facet of ours must be one of theirs, and each of theirs one of ours. As links the same files become convex bodies:
points of every facet must lie in one of them. Then files with one number changed or one facet taken away must not agree.
"""
import random
import struct
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy
import trimesh

FILES_A_KIND = 12
# Both sides hold single precision somewhere; the meshes are about a metre large.
TOLERANCE_M = 3e-6


def solid(rng, sides):
    """A prism over a convex polygon somewhere: corners, and polygons of corner indices, counter-clockwise from outside."""
    at = [rng.uniform(-0.6, 0.6) for _ in range(3)]
    radius, height = rng.uniform(0.05, 0.3), rng.uniform(0.05, 0.4)
    corners = []
    for z in (0.0, height):
        for i in range(sides):
            angle = 2.0 * numpy.pi * (i + 0.3) / sides
            corners.append([at[0] + radius * numpy.cos(angle), at[1] + radius * numpy.sin(angle), at[2] + z])
    faces = [list(range(sides))[::-1], [sides + i for i in range(sides)]]
    for i in range(sides):
        j = (i + 1) % sides
        faces.append([i, j, sides + j, sides + i])
    corners = [[float(numpy.float32(c)) for c in corner] for corner in corners]
    return corners, faces


def solids(rng):
    return [solid(rng, rng.randint(3, 7)) for _ in range(rng.randint(1, 4))]


def fans(faces):
    return [[face[0], face[i], face[i + 1]] for face in faces for i in range(1, len(face) - 1)]


def stl_binary(rng, parts, header):
    facets = [[corners[i] for i in fan] for corners, faces in parts for fan in fans(faces)]
    body = b"".join(struct.pack("<12fH", 0, 0, 0, *[c for corner in f for c in corner], 0) for f in facets)
    return header.ljust(80)[:80] + struct.pack("<I", len(facets)) + body


def stl_ascii(rng, parts, one):
    lines = []
    if one:
        lines.append("solid all")
    for i, (corners, faces) in enumerate(parts):
        if not one:
            lines.append(f"solid part {i}")
        for fan in fans(faces):
            lines += ["  facet normal 0 0 0", "    outer loop"]
            lines += ["      vertex " + " ".join(f"{c:.9e}" for c in corners[k]) for k in fan]
            lines += ["    endloop", "  endfacet"]
        if not one:
            lines.append(f"endsolid part {i}")
    if one:
        lines.append("endsolid all")
    return "\n".join(lines) + "\n"


def obj(rng, parts, style):
    lines = ["# by a test", "mtllib none.mtl"]
    count, normals = 0, 0
    if style == "negative":
        # trimesh counts back from the end of the file, not from the line: all corners first, so that both are the same.
        lines += ["v " + " ".join(f"{c:.9e}" for c in corner) for corners, _ in parts for corner in corners]
    for i, (corners, faces) in enumerate(parts):
        lines.append({"objects": f"o part{i}", "groups": f"g part{i} side", "materials": f"usemtl m{i}"}.get(style, "s off"))
        if style != "negative":
            lines += ["v " + " ".join(f"{c:.9e}" for c in corner) for corner in corners]
        if style == "normals":
            lines += ["vt 0.5 0.5", "vn 0 0 1"]
            normals += 1
        if style == "lines":
            lines += [f"l {count + 1} {count + 2}", f"p {count + 1}"]
        for face in faces:
            if style == "negative":
                words = [str(count + k - sum(len(corners) for corners, _ in parts)) for k in face]
            elif style == "normals":
                words = [f"{count + k + 1}/{normals}/{normals}" for k in face]
            else:
                words = [str(count + k + 1) for k in face]
            lines.append("f " + (" \\\n ".join(words) if style == "continued" else " ".join(words)))
        count += len(corners)
    return "\n".join(lines) + "\n"


def dae(rng, parts, style, unit=1.0):
    geometries, nodes = [], []
    for i, (corners, faces) in enumerate(parts):
        numbers = " ".join(f"{c / unit:.9e}" for corner in corners for c in corner)
        # A second input between the indices of the corners must be stepped over.
        word = lambda face: " ".join(f"{k} 0" for k in face)
        inputs = f'<input semantic="VERTEX" source="#v{i}" offset="0"/><input semantic="NORMAL" source="#n{i}" offset="1"/>'
        if style == "triangles":
            body = f'<triangles count="{len(fans(faces))}">{inputs}<p>{" ".join(word(f) for f in fans(faces))}</p></triangles>'
        elif style == "polygons":
            body = f'<polygons count="{len(faces)}">{inputs}{"".join(f"<p>{word(f)}</p>" for f in faces)}</polygons>'
        else:
            counts = " ".join(str(len(f)) for f in faces)
            body = (f'<polylist count="{len(faces)}">{inputs}<vcount>{counts}</vcount>'
                    f'<p>{" ".join(word(f) for f in faces)}</p></polylist>')
        geometries.append(
            f'<geometry id="g{i}" name="g{i}"><mesh><source id="s{i}"><float_array id="f{i}" count="{3 * len(corners)}">{numbers}'
            f'</float_array><technique_common><accessor source="#f{i}" count="{len(corners)}" stride="3"><param name="X" '
            f'type="float"/><param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>'
            f'<source id="n{i}"><float_array id="m{i}" count="3">0 0 1</float_array><technique_common><accessor source="#m{i}" '
            f'count="1" stride="3"><param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/>'
            f'</accessor></technique_common></source><vertices id="v{i}"><input semantic="POSITION" source="#s{i}"/></vertices>'
            f"{body}</mesh></geometry>"
        )
        # pycollada takes the axis as it is; ours makes it a unit vector. Given one, both must agree.
        turn = numpy.array([rng.uniform(-1, 1) for _ in range(3)])
        turn /= numpy.linalg.norm(turn)
        shift = " ".join(f"{rng.uniform(-0.3, 0.3) / unit:.6f}" for _ in range(3))
        nodes.append(
            f'<node id="node{i}"><translate>{shift}</translate><rotate>{turn[0]:.12f} {turn[1]:.12f} {turn[2]:.12f} '
            f'{rng.uniform(-170, 170):.3f}</rotate><node id="inner{i}"><matrix>0 -1 0 {0.1 / unit:.6f} 1 0 0 0 0 0 0.5 0 0 0 0 1</matrix>'
            f'<instance_geometry url="#g{i}"/></node><node id="again{i}"><scale>0.5 0.7 0.9</scale>'
            f'<instance_geometry url="#g{i}"/></node></node>'
        )
    return (
        '<?xml version="1.0" encoding="utf-8"?>\n<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">\n'
        f'<asset><created>2026-01-01T00:00:00</created><modified>2026-01-01T00:00:00</modified><unit name="u" meter="{unit}"/>'
        f"<up_axis>Z_UP</up_axis></asset><library_geometries>{''.join(geometries)}</library_geometries>\n"
        f'<library_visual_scenes><visual_scene id="scene">{"".join(nodes)}</visual_scene></library_visual_scenes>\n'
        '<scene><instance_visual_scene url="#scene"/></scene></COLLADA>\n'
    )


MARK = "\ufeff".encode()
# Kind, ending, what writes it, and whether the independent reader takes a byte order mark (it is given the file without).
KINDS = [
    ("STL, binary", "stl", lambda r, p: stl_binary(r, p, b"by a test")),
    ("STL, binary that begins with solid", "stl", lambda r, p: stl_binary(r, p, b"solid by a test")),
    ("STL, one solid", "stl", lambda r, p: stl_ascii(r, p, True).encode()),
    ("STL, several solids", "stl", lambda r, p: stl_ascii(r, p, False).encode()),
    ("STL, with a mark and CRLF", "stl", lambda r, p: MARK + stl_ascii(r, p, False).replace("\n", "\r\n").encode()),
    ("OBJ, plain", "obj", lambda r, p: obj(r, p, "plain").encode()),
    ("OBJ, objects", "obj", lambda r, p: obj(r, p, "objects").encode()),
    ("OBJ, groups", "obj", lambda r, p: obj(r, p, "groups").encode()),
    ("OBJ, materials", "obj", lambda r, p: obj(r, p, "materials").encode()),
    ("OBJ, negative indices", "obj", lambda r, p: obj(r, p, "negative").encode()),
    ("OBJ, texture and normals", "obj", lambda r, p: obj(r, p, "normals").encode()),
    ("OBJ, lines and points", "obj", lambda r, p: obj(r, p, "lines").encode()),
    ("OBJ, continued lines", "obj", lambda r, p: obj(r, p, "continued").encode()),
    ("OBJ, with a mark and CRLF", "obj", lambda r, p: MARK + obj(r, p, "groups").replace("\n", "\r\n").encode()),
    ("DAE, triangles", "dae", lambda r, p: dae(r, p, "triangles").encode()),
    ("DAE, polylist", "dae", lambda r, p: dae(r, p, "polylist").encode()),
    ("DAE, polygons in millimetres", "dae", lambda r, p: dae(r, p, "polygons", 0.001).encode()),
    ("DAE, with a mark, in inches", "dae", lambda r, p: MARK + dae(r, p, "polylist", 0.0254).encode()),
]


def theirs(file, ending):
    """Facets by the independent readers, in metres; nothing merged, nothing dropped."""
    plain = file.with_name(f"plain-{file.name}")
    # It knows neither marks nor continued lines: those are ours to read, so that it gets the file without them.
    plain.write_bytes(file.read_bytes().removeprefix(MARK).replace(b"\\\n", b""))
    if ending != "dae":
        loaded = trimesh.load(plain, process=False)
        return (loaded.to_mesh() if isinstance(loaded, trimesh.Scene) else loaded).triangles
    loaded = trimesh.load(plain, process=False)
    unit = float(str(loaded.units).split()[0]) if "*" in str(loaded.units) else 1.0
    return loaded.to_mesh().triangles * unit


def ours(program, file):
    """What our reader makes of the file's obstacles or links: name to list of bodies of facets, with their roundings."""
    done = subprocess.run([program, file], capture_output=True, text=True)
    if done.returncode != 0:
        raise SystemExit(f"{program} {file}: {done.stderr}")
    found, body = {}, None
    for line in done.stdout.splitlines():
        words = line.split()
        if words[0] in ("mesh", "hull"):
            body = []
            found.setdefault(words[1], []).append((body, float(words[2]) if len(words) > 2 else 0.0))
        else:
            body.append([float(w) for w in words])
    return {
        name: [(numpy.array(facets).reshape(-1, 3, 3), rounding) for facets, rounding in bodies] for name, bodies in found.items()
    }


def differ(mine, other):
    """Why the facets are not the same ones; None when each has its twin, up to which corner is named first."""
    if len(mine) != len(other):
        return f"{len(mine)} facets for {len(other)}"
    free = numpy.ones(len(other), dtype=bool)
    for facet in mine:
        gaps = numpy.min([numpy.abs(other - numpy.roll(facet, k, axis=0)).max(axis=(1, 2)) for k in range(3)], axis=0)
        gaps[~free] = numpy.inf
        nearest = int(gaps.argmin())
        if not gaps[nearest] <= TOLERANCE_M:
            return f"facet {facet.tolist()} is {gaps[nearest]:.2e} m from the nearest"
        free[nearest] = False
    return None


def outside_m(bodies, facets):
    """How far the worst of many points of the facets stands out of all bodies."""
    steps = [(u / 6, v / 6) for u in range(7) for v in range(7 - u)]
    points = numpy.concatenate([facets[:, 0] + u * (facets[:, 1] - facets[:, 0]) + v * (facets[:, 2] - facets[:, 0]) for u, v in steps])
    least = numpy.full(len(points), numpy.inf)
    for faces, rounding in bodies:
        normals = numpy.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0])
        normals /= numpy.linalg.norm(normals, axis=1)[:, None]
        beyond = points @ normals.T - (faces[:, 0] * normals).sum(axis=1)
        least = numpy.minimum(least, beyond.max(axis=1) - rounding)
    return least.max()


def write_all(folder):
    scene, links, files = [], [], {}
    for kind, (what, ending, write) in enumerate(KINDS):
        for number in range(FILES_A_KIND):
            rng = random.Random(1000 * kind + number)
            name = f"k{kind}n{number}"
            file = folder / f"{name}.{ending}"
            file.write_bytes(write(rng, solids(rng)))
            files[name] = (what, file, ending)
            scene.append(f'[[mesh]]\nname = "{name}"\nfile = "{file.name}"\ncenter_m = [0, 0, 0]\n')
    (folder / "scene.toml").write_text("".join(scene))
    for name, (_, file, _) in files.items():
        links.append(
            f'<link name="{name}"><collision><geometry><mesh filename="{file.name}"/></geometry></collision></link>'
            f'<joint name="j{name}" type="fixed"><parent link="root"/><child link="{name}"/></joint>'
        )
    (folder / "arm.urdf").write_text(
        f'<robot name="arm"><link name="root"/>{"".join(links)}<link name="tip"><collision><origin xyz="5 0 0"/><geometry><sphere '
        'radius="0.1"/></geometry></collision></link><joint name="turn" type="revolute"><parent link="root"/><child link="tip"/>'
        '<limit lower="-1" upper="1" velocity="1" effort="1"/></joint></robot>'
    )
    (folder / "arm.toml").write_text(
        'name = "arm"\nurdf = "arm.urdf"\ntip_link = "tip"\n[[joint]]\nname = "turn"\n'
        "motion = { acceleration_rad_s2 = 1.0, jerk_rad_s3 = 1.0 }\n"
    )
    return files


def main():
    program = sys.argv[1]
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        files = write_all(folder)
        obstacles, links = ours(program, folder / "scene.toml"), ours(program, folder / "arm.toml")
        counted, worst_m = {}, -numpy.inf
        for name, (what, file, ending) in files.items():
            other = theirs(file, ending)
            [(mine, _)] = obstacles[name]
            fault = differ(mine, other)
            if fault:
                raise SystemExit(f"{what}, {file.name}: {fault}")
            out_m = outside_m(links[name], other)
            worst_m = max(worst_m, out_m)
            if out_m > TOLERANCE_M:
                raise SystemExit(f"{what}, {file.name}: as a link {out_m:.2e} m of it stand out of its bodies")
            counted[what] = counted.get(what, 0) + len(other)
            # The comparison must be able to fail.
            moved = mine.copy()
            moved[len(mine) // 2, 1, 2] += 1e-4
            shrunk = [(faces[:, :, :] * 0.99, rounding) for faces, rounding in links[name]]
            if not differ(moved, other) or not differ(mine[1:], other) or outside_m(shrunk, other) <= TOLERANCE_M:
                raise SystemExit(f"{what}, {file.name}: a corrupted mesh was not seen")
    for what, facets in counted.items():
        print(f"{what}: {FILES_A_KIND} files, {facets} facets, the same on both sides")
    print(f"as links: nothing of any file stands out of its bodies (worst {worst_m:.1e} m)\nMESHES OK")


if __name__ == "__main__":
    main()
