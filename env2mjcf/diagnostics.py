"""The catalogue of diagnostic codes: what each one means.

Codes are stable. `ENV` concerns text files, `GEO` meshes, `KIN` bodies and connections, `MJC` what is written for
MuJoCo, `CFG` configurations and queries.
"""

from __future__ import annotations

CATALOGUE: dict[str, str] = {
    # Text files: 1xx encoding and syntax, 2xx words and counts, 3xx things read but not used.
    # Meshes.
    "GEO201": "A mesh file that a scene names is missing.",
    "GEO202": "A mesh file lies outside the scene's folder and `mesh_dirs`.",
    "GEO203": "What a scene names as a mesh is a folder, a broken link or no possible file name.",
    "GEO204": "A mesh file may not, or cannot, be read.",
    "GEO205": "A mesh file was found only by ignoring the case of its name.",
    "GEO206": "A mesh file was found only by reading backslashes as slashes.",
    "GEO207": "The extension of a mesh file is not one that can be read.",
    "GEO208": "A mesh of a format that the original planner did not read; trimesh reads it.",
    "GEO209": "A mesh exceeds one of `limits`.",
    "GEO210": "A mesh is empty: no vertices, or no triangles.",
    "GEO211": "A word in a mesh file is not a number, or the file is not text.",
    "GEO212": "A number in a mesh file is not finite.",
    "GEO213": "A mesh file, or a vertex in it, ends too early.",
    "GEO214": "A polygon names a vertex that does not exist.",
    "GEO215": "A mesh file goes on behind its last polygon.",
    "GEO216": "A count or an index in a mesh file is not a positive integer.",
    "GEO217": "The edge count of a BYU header is not the number of polygon corners; not used.",
    "GEO218": "The part ranges of a BYU file do not cover its polygons; not used.",
    "GEO219": "A BYU file has not exactly one part; dialect A's planner misreads it.",
    "GEO220": "Polygons with more than three corners were cut into triangles; the original planner reads them otherwise.",
    "GEO221": "Polygons with fewer than three corners were skipped.",
    "GEO222": "Polygons cross themselves.",
    "GEO223": "Numbers of a BYU file touch; it was read as columns of fixed width.",
    "GEO224": "An OBJ file has negative indices, which the original planner does not read.",
    "GEO225": "An OBJ file has lines that are not read.",
    "GEO226": "trimesh cannot read a mesh file.",
    "GEO227": "A polygon has too many corners.",
    "GEO230": "All points of a mesh lie in one plane; it collides as a thin plate.",
    "GEO231": "A mesh has no area: it is a point or a line.",
    "GEO232": "A mesh is not closed; it collides as a sheet without inside.",
    "GEO233": "A closed mesh, or part of it, is wound inside out; its faces were turned round.",
    "GEO234": "Faces of a mesh are wound inconsistently; its pieces grow to both sides of the surface.",
    "GEO235": "Copies of faces were dropped.",
    "GEO236": "Faces of no height were dropped.",
    "GEO237": "A mesh is in several pieces.",
    "GEO238": "Vertices of a mesh are used by no face.",
    "GEO239": "Edges of a mesh have more than two faces.",
    "GEO240": "A mesh that is not convex collides as its convex hull, by choice.",
    "GEO241": "Polygons of a mesh are too small for MuJoCo and do not collide.",
    "GEO242": "Vertices lay on edges of other faces (T-junctions); those faces were cut there.",
    "GEO243": "A mesh without inside collides as a surface, though it was to be solid.",
    # Bodies and connections.
    # What is written for MuJoCo.
    # Configurations and queries.
}
