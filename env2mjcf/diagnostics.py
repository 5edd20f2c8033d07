"""The catalogue of diagnostic codes, what each one means; and the log that findings go to.

Codes are stable. `ENV` concerns text files, `GEO` meshes, `KIN` bodies and connections, `MJC` what is written for
MuJoCo, `CFG` configurations and queries.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import asdict, replace
from typing import NoReturn

from .errors import (
    ConversionError,
    Diagnostic,
    Env2MjcfError,
    FolderGivenError,
    ForbiddenFileError,
    FormatError,
    GeometryError,
    KinematicsError,
    MissingFileError,
    MissingMeshError,
    Severity,
    Span,
)

CATALOGUE: dict[str, str] = {
    # Text files that cannot be read: 10x the file, 11x numbers and words, 12x keywords, 13x the kind, 14x XML.
    "ENV101": "A file that is named does not exist.",
    "ENV102": "A folder stands where a file was expected.",
    "ENV103": "A file may not be read by this user.",
    "ENV104": "A file cannot be read: its name is impossible, links lead in a circle, or the disk is at fault.",
    "ENV105": "A file is larger than `limits.file_bytes`.",
    "ENV106": "A file is UTF-16 text.",
    "ENV107": "A file is not text.",
    "ENV108": "A file is not UTF-8; it was read as Latin-1.",
    "ENV109": "A word is longer than `limits.name_length`.",
    "ENV110": "A count is negative or beyond one of `limits`.",
    "ENV111": "A file, line or value ends too early.",
    "ENV112": "A word or number stands where something else was expected.",
    "ENV113": "A number is not finite.",
    "ENV114": "A range is empty: its lower end lies above its upper end.",
    "ENV115": "The index of a body is out of range.",
    "ENV116": "A connection leads from a body to itself.",
    "ENV117": "A multibody has no bodies.",
    "ENV118": "The mass of a body is not positive.",
    "ENV119": "A boundary has too few ranges, or a radius that is not positive.",
    "ENV120": "An unknown tag.",
    "ENV121": "An unknown joint type.",
    "ENV122": "An unknown tag of a body of dialect A.",
    "ENV123": "An unknown base, or one that an obstacle cannot have.",
    "ENV124": "An unknown option of a body, or an unknown adjustment.",
    "ENV125": "An unknown shape of the boundary.",
    "ENV130": "A file is empty, or not of a known kind.",
    "ENV131": "A robot file stands where an environment was expected.",
    "ENV132": "An XML file is neither a scene nor a robot; it was skipped.",
    "ENV133": "An environment stands where a robot file was expected.",
    "ENV140": "An XML file is not well-formed.",
    "ENV141": "An XML element lacks an attribute.",
    "ENV142": "An XML attribute is not one of the words that it can be.",
    "ENV143": "An XML attribute holds more than was expected.",
    "ENV144": "An XML file declares entities, or names others than the five of XML.",
    "ENV145": "An XML element does not have exactly one child of a kind.",
    "ENV146": "The links of an XML robot do not stand in the order of their indices.",
    "ENV147": "A link of an XML robot does not hold the one connection that leads to it.",
    "ENV148": "A problem file names no environment.",
    "ENV149": "A task is for a robot that the problem file does not name.",
    "ENV150": "A problem file names a file outside its folder.",
    "ENV151": "Two robots of a problem file have the same label.",
    "ENV152": "A link in a folder that is searched leads out of all that was named.",
    # What another dialect cannot express.
    "ENV160": "A dialect has no boundary in its file, or none of this shape; it is lost.",
    "ENV161": "A dialect must have a boundary, and the scene has none; a wide box is written.",
    "ENV162": "A dialect has no resolution of some kind in its file; it is lost.",
    "ENV163": "Dialects A and B have no limits of joints; they are lost.",
    "ENV164": "Hinges of dialect A turn without end; in other dialects they have limits half a turn either way.",
    "ENV165": "A dialect has no joints of a type.",
    "ENV166": "The planner of a dialect knows no Prismatic joints; they are written all the same.",
    "ENV167": "Dialect A cannot carry a body like this.",
    "ENV168": "A dialect has no pose for a free base; it is at home at the origin.",
    "ENV169": "Dialects A to C move the mean of a mesh's vertices to the origin, and a mesh must not be moved.",
    "ENV170": "A dialect has no masses, textures, transparent colours, or labels of surfaces; they are lost.",
    "ENV171": "Meshes lie outside the folder that an environment is written into.",
    "ENV172": "A dialect has no adjacencies; they are lost.",
    "ENV173": "A dialect has no NonHolonomic robots; written as Active.",
    "ENV174": "A dialect has no surfaces.",
    "ENV175": "A robot's fixed base is tested against obstacles in dialects B to E, and not in A.",
    "ENV176": "The planner of a dialect takes one robot, or one base of each, and the scene has several or none.",
    "ENV177": "Text files cannot express something that an XML file says; it is lost.",
    "ENV178": "The name of a mesh file is not a single word.",
    "ENV179": "A translation cannot be written.",
    # Limits.
    "ENV180": "An XML file has more elements, or more within each other, than `limits.elements` and `limits.nesting`.",
    "ENV181": "An XML file holds a text of more than ten million characters, or a name of more than fifty thousand.",
    "ENV182": "A file has more configurations or nodes than `limits.rows`.",
    "ENV183": "A boundary, or a limit of a joint, is too large to be computed with.",
    # Tasks of several robots, and rules about pairs, of problem files.
    "ENV184": "A group names an unknown robot, or a group task an unknown group.",
    "ENV185": "A rule about pairs stands where it does not count, or is spelled otherwise, and is not followed.",
    "ENV186": "A group task does not have a task for each robot of its group, or has one for another robot.",
    "ENV187": "The robots of a group task visit different numbers of configurations; who is done waits at its goal.",
    # What a translation does not replace.
    "ENV190": "A file that is not an env file, robot file or query, or not of the scene that is replaced, is kept.",
    # Text files that are doubtful.
    "ENV201": "A keyword is written in a case that the original reader does not take.",
    "ENV202": "A keyword is misspelt, or another word stands in its place; it was read as meant.",
    "ENV203": "A file declares another number of things than it has.",
    "ENV204": "A joint has no limits in a dialect that demands them.",
    "ENV205": "`Connection` stands for `Connections`.",
    "ENV206": "A boundary has no shape; it was read as a box.",
    "ENV207": "A Box2D has three ranges; all are used.",
    "ENV208": "The header names an unknown version of the format.",
    "ENV209": "Text after the end of the scene or robot is not used.",
    "ENV210": "A file does not end with a newline.",
    "ENV211": "A robot file begins with a tag.",
    "ENV212": "A boundary of the configuration space is used as one of the workspace.",
    "ENV213": "An XML attribute should be true or false; it is not used.",
    "ENV214": "A problem file is not well-formed after its problem; only that was read.",
    "ENV215": "The components of a colour are not numbers from 0 to 1.",
    "ENV216": "An environment of dialect E holds a robot or a surface.",
    "ENV217": "The controls of a NonHolonomic robot are not equally long.",
    "ENV218": "The header names a class whose configurations have a layout of their own.",
    "ENV219": "A fixed body of an XML file has no pose; it stands at the origin.",
    # What is worth knowing about text files.
    "ENV301": "The pose of a FreeBody of dialect A that a connection places is not used.",
    "ENV302": "A box with two ranges leaves z unbounded.",
    "ENV303": "DH angles are so large that they look like degrees where radians are read.",
    "ENV304": "A Prismatic connection slides, which the original planner never did.",
    "ENV305": "Limits of a joint are so large that they look like degrees where fractions of pi are read.",
    "ENV306": "A resolution is not positive; the planner computes one of its own.",
    "ENV307": "An XML element is not used.",
    "ENV308": "The actuators of an XML robot are kept, but not simulated.",
    "ENV309": "A problem file says which pairs collide, and is followed.",
    "ENV310": "A scene has no robot.",
    "ENV311": "An XML attribute is not used.",
    # Meshes.
    "GEO201": "A mesh file that a scene names is missing.",
    "GEO202": "A mesh file lies outside the scene's folder and `mesh_dirs`.",
    "GEO203": "What a scene names as a mesh is a folder, a broken link or not a possible file name.",
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
    "GEO215": "A mesh file goes on after its last polygon.",
    "GEO216": "A count or an index in a mesh file is not a positive integer.",
    "GEO217": "The edge count of a BYU header is not the number of polygon corners; not used.",
    "GEO218": "The part ranges of a BYU file do not cover its polygons; not used.",
    "GEO219": "A BYU file does not have exactly one part; dialect A's planner misreads it.",
    "GEO220": "Polygons with more than three corners were cut into triangles, unlike in the original planner.",
    "GEO221": "Polygons with fewer than three corners were skipped.",
    "GEO222": "Polygons cross themselves.",
    "GEO223": "Numbers of a BYU file touch; it was read as columns of fixed width.",
    "GEO224": "An OBJ file has negative indices, which the original planner does not read.",
    "GEO225": "An OBJ file has lines that are not read.",
    "GEO226": "trimesh cannot read a mesh file.",
    "GEO227": "A polygon has too many corners.",
    "GEO228": "`mesh_dirs` names something that is not a folder.",
    "GEO229": "A mesh file ends with DOS's mark of the end, the byte 0x1A, which is not read.",
    "GEO230": "All points of a mesh lie in one plane; it collides as a thin plate.",
    "GEO231": "A mesh has no area: it is a point or a line.",
    "GEO232": "A mesh, or a piece of it, is not closed; it collides as a sheet without inside.",
    "GEO233": "A closed mesh, or part of it, is wound inside out; its faces were turned round.",
    "GEO234": "Faces of a mesh are wound inconsistently; they were turned round to agree, where that is possible.",
    "GEO235": "Copies of faces were dropped.",
    "GEO236": "Faces without area were dropped.",
    "GEO237": "A mesh is in several pieces.",
    "GEO238": "Vertices of a mesh are used by no face.",
    "GEO239": "Edges of a mesh have more than two faces.",
    "GEO240": "A mesh that is not convex collides as its convex hull, by choice.",
    "GEO241": "A mesh, or some of its polygons, are too small for MuJoCo and do not collide.",
    "GEO242": "Vertices lay on edges of other faces (T-junctions); those faces were cut there.",
    "GEO243": "A mesh without inside collides as a surface, though it was to be solid.",
    "GEO244": "Flat parts of a closed mesh were folded over themselves; they were triangulated anew.",
    "GEO245": "Closed pieces of a moving body overlap, or lie in each other; the mass is that of their union.",
    "GEO246": "Closed pieces of a moving body overlap, and what they share counts twice in the mass.",
    "GEO250": "The inertia of a body was not computed from its volume alone.",
    "GEO251": "A scene is so large or small that its unit is hardly the metre.",
    "GEO252": "A body lies too far from the origin to be computed with.",
    "GEO253": "The bodies are far from the file's origin; the MJCF has one amid them.",
    "GEO254": "Bodies, or the vertices of a mesh, are so far from their origin that rounding would decide verdicts.",
    "GEO255": "A mesh is in single precision and far from its origin, so that its numbers are coarse.",
    "GEO260": "An entry of the geometry cache was damaged and has been made anew.",
    "GEO261": "The geometry cache cannot be read or written; everything is computed.",
    "GEO262": "CoACD crashed, hung, or gave no parts.",
    "GEO263": "A mesh that is not convex collides as approximate parts, by choice.",
    "GEO270": "Polygons of a mesh take more work to cut into triangles than `limits.polygon_work`.",
    "GEO271": "The bodies of a scene have more triangles in all than `limits.scene_elements`.",
    "GEO272": "The bodies of a scene collide as more convex pieces in all than `limits.scene_cells`.",
    "GEO273": "A mesh takes more work to repair and to cut into convex pieces than `limits.mesh_work`.",
    "GEO274": "A mesh file is UTF-16 or UTF-32 text.",
    "GEO275": "The bodies of a scene make more pairs that may touch than `limits.pairs`.",
    "GEO276": "A mesh has coordinates that are too large to be computed with.",
    # Bodies and connections.
    "KIN301": "No connection leads to a body that has no base.",
    "KIN302": "No connection leads to a later FreeBody of dialect A; it is a base of its own, at home at its own pose.",
    "KIN303": "Bodies hang in a cycle of connections that no base belongs to.",
    "KIN310": "A joint value of the file lies outside its limits; home has the nearest one inside.",
    "KIN311": "A closed loop is open at home; its equality is written, but inactive.",
    "KIN312": "Two bodies touch at home.",
    "KIN313": "Pairs that touch at home are not tested, as was asked for.",
    "KIN314": "A robot that travels is at home far from all else; its place does not count in the extent.",
    "KIN315": "More pairs touch at home, or may touch there, than are listed one by one.",
    "KIN320": "An SMAJoint cannot be converted.",
    # What is written for MuJoCo.
    "MJC401": "MuJoCo refuses a model.",
    "MJC402": "MuJoCo warns of a model, and Python is told that warnings are errors.",
    "MJC403": "A chain has more links than MuJoCo's XML parser reads within each other.",
    "MJC404": "There is no room for the memory that a model asks MuJoCo for.",
    "MJC405": "MuJoCo's memory cannot hold all contacts of a configuration.",
    "MJC407": "A fault of env2mjcf, or too little memory, ended the look at one file.",
    "MJC410": "A loop that closes by a slide stays open in the simulation.",
    "MJC411": "A free base gets no actuator.",
    "MJC412": "The gravity of the file is not used, or its friction not written.",
    "MJC413": "Controls and velocity bounds of a NonHolonomic robot are not written.",
    "MJC414": "A texture is not drawn.",
    "MJC415": "The boundary was to be drawn or built, and the scene has none.",
    "MJC416": "Boxes were to be written as box geoms, and no body collides as a box.",
    "MJC417": "Of the joints of closed loops as many are driven as can move independently.",
    "MJC418": "Gravity does not pull bodies to the ground.",
    "MJC419": "Bodies of many convex pieces can have so many contacts that MuJoCo is slow, or its memory too small.",
    "MJC420": "The output folder may not be written.",
    "MJC421": "A file stands where the output folder should be.",
    "MJC422": "The output cannot be written.",
    "MJC423": "A file that is not MJCF stands where the MJCF would be written; it is kept.",
    "MJC424": "Another process keeps the output folder locked.",
    # Configurations and queries.
    "CFG501": "Text ends the list of configurations of a query.",
    "CFG502": "A word in a row of configurations is not a finite number.",
    "CFG503": "A file holds no configuration.",
    "CFG504": "A row of numbers fits no robot.",
    "CFG505": "A NumPy file holds no rows of numbers, or one that is not finite or too large.",
    "CFG506": "The rows of a query are built in different ways.",
    "CFG507": "Velocities or info fields after configurations are not used.",
    "CFG508": "A query holds one configuration only.",
    "CFG509": "The output of a batch cannot be written, or a file that is not its own stands in its way.",
    # Paths and roadmaps.
    "CFG510": "The first line of a path file is not its header.",
    "CFG511": "The header of a path file is not written as the newest planner insists.",
    "CFG512": "A path file has a version that is not known.",
    "CFG513": "Line 2 of a path file does not say what its rows are.",
    "CFG514": "A path file declares another number of configurations than it has.",
    "CFG515": "The second or third line of a path file is not a number, or missing.",
    "CFG516": "The last configuration of a path file lacks poses of links.",
    "CFG517": "A path file holds poses of another number of links than the robot has.",
    "CFG518": "Recorded poses of links belong to no configuration of the robot.",
    "CFG519": "A task has no start; it begins where the robot's task before it ends, else at its first goal.",
    "CFG520": "A roadmap has no graph.",
    "CFG521": "The counts of a roadmap are not whole numbers, or missing.",
    "CFG522": "A roadmap ends too early.",
    "CFG523": "A roadmap declares another number of nodes or edges than it has.",
    "CFG524": "A roadmap has no end mark.",
    "CFG525": "Two nodes of a roadmap have the same id.",
    "CFG526": "An edge of a roadmap leads to a node that is not there; it is not used.",
    "CFG527": "An edge of a roadmap stands at one of its ends only.",
    "CFG528": "An edge of a roadmap leads from a node to itself; it is not used.",
    "CFG529": "A word in a roadmap is not what a node or an edge has there.",
    "CFG530": "A section of a roadmap has no end; it is not used.",
    "CFG531": "Velocities or controls of a roadmap are not used.",
    "CFG532": "A path, roadmap or query cannot be written.",
    "CFG533": "An edge of a roadmap joins nodes of different robots; it is not used.",
    "CFG534": "Edges of a roadmap were made by a local planner that is not known; they are checked as straight ways.",
    "CFG535": "A path or roadmap of dialect A's time is read in turns for a scene of a later dialect.",
    "CFG536": "The file's PositionRes is so small that planning, or checking an edge, would never end.",
    "CFG537": "An edge is so long that checking it would never end.",
    "CFG540": "There is no task to plan.",
    "CFG541": "A task to plan has no goal.",
    "CFG542": "A planned path cannot be written.",
    "CFG543": "Nothing moves in a scene, so that it has no configurations, paths or plans.",
    "CFG550": "Configurations of a path to be shown are beyond the limits; its units may be others.",
    "CFG551": "A path to be shown holds one configuration only.",
    "CFG552": "A picture or film cannot be written.",
    "CFG553": "A file that is not a path stands where a path would be written; it is kept.",
}

_CLASSES: dict[str, type[Env2MjcfError]] = {
    "ENV": FormatError,
    "GEO": GeometryError,
    "KIN": KinematicsError,
    "MJC": ConversionError,
    "CFG": FormatError,
}
# What cannot be expressed, or not be written, although it was read.
_NOT_EXPRESSED = {*(f"ENV{n}" for n in range(160, 180)), "ENV190", "KIN320"}
_NOT_WRITTEN = {"CFG509", "CFG532", "CFG542", "CFG552", "CFG553"}
# What Python has a class for, too.
_OF_FILES: dict[str, type[Env2MjcfError]] = {
    "ENV101": MissingFileError,
    "ENV102": FolderGivenError,
    "ENV103": ForbiddenFileError,
    "GEO201": MissingMeshError,
}


def error_class(code: str) -> type[Env2MjcfError]:
    """Return the class of the error that is raised with a code."""
    if code in _OF_FILES:
        return _OF_FILES[code]
    return ConversionError if code in _NOT_EXPRESSED | _NOT_WRITTEN else _CLASSES[code[:3]]


# Findings of one code that are kept, so that a file of nothing but faults takes little memory.
_KEPT = 1000
# Findings of one code that are shown, and bytes of JSON that all may take, about twice those of text.
_SHOWN, _SHOWN_BYTES = 10, 20_000


class DiagnosticLog:
    """Collects diagnostics; in strict mode the first warning is raised as an error.

    A code tells the class of its error; `info`, `warn` and `fail` say how bad it is. Of each code the first thousand
    are kept; one diagnostic more then stands for all others, and says how many they are.

    Args:
        strict: Whether warnings are errors.
    """

    def __init__(self, strict: bool = False) -> None:
        self.strict = strict
        self._items: list[Diagnostic] = []
        self._counts: Counter[tuple[str, Severity]] = Counter()
        # The first that is not kept, of each code.
        self._others: dict[tuple[str, Severity], Diagnostic] = {}

    def __iter__(self) -> Iterator[Diagnostic]:
        yield from self._items
        kept = Counter((d.code, d.severity) for d in self._items) if self._others else {}
        for key, first in self._others.items():
            yield _standing_for(first, self._counts[key] - kept[key], self._counts[key])

    def __len__(self) -> int:
        return len(self._items) + len(self._others)

    def keeps(self, code: str, severity: Severity) -> bool:
        """Whether one more finding of a code would be kept, so that a hint for it is worth looking for."""
        return self._counts[code, severity] < _KEPT

    def extend(self, diagnostics: Iterable[Diagnostic]) -> None:
        """Add findings that an earlier stage has already judged."""
        for diagnostic in diagnostics:
            self.add(diagnostic, diagnostic.times == 1 and self.keeps(diagnostic.code, diagnostic.severity))

    def info(self, code: str, subject: str, message: str, *, hint: str = "", span: Span | None = None) -> None:
        """Record something worth knowing that is not a fault."""
        self._record(code, Severity.INFO, subject, message, hint, span)

    def warn(self, code: str, subject: str, message: str, *, hint: str = "", span: Span | None = None) -> None:
        """Record something doubtful; raise it in strict mode."""
        if self.strict:
            self.fail(code, subject, message, hint=hint, span=span)
        self._record(code, Severity.WARNING, subject, message, hint, span)

    def fail(self, code: str, subject: str, message: str, *, hint: str = "", span: Span | None = None) -> NoReturn:
        """Raise a fault, with everything recorded before it."""
        raise error_class(code)(Diagnostic(code, Severity.ERROR, subject, message, hint, span), self)

    def _record(self, code: str, severity: Severity, subject: str, message: str, hint: str, span: Span | None) -> None:
        key = code, severity
        if key in self._others:
            self._counts[key] += 1
        else:
            self.add(Diagnostic(code, severity, subject, message, hint, span), self.keeps(code, severity))

    def add(self, diagnostic: Diagnostic, kept: bool) -> None:
        """Add a finding to those that are kept, or only count it."""
        key = diagnostic.code, diagnostic.severity
        self._counts[key] += diagnostic.times
        if kept:
            self._items.append(diagnostic)
        else:
            self._others.setdefault(key, diagnostic)


def few(diagnostics: Iterable[Diagnostic]) -> tuple[Diagnostic, ...]:
    """Return a few findings of each code, and one more that stands for its others: what people read, a page or two.

    An error that ends the list, as in `Env2MjcfError.diagnostics`, is always among them.
    """
    listed = list(diagnostics)
    end = [listed.pop()] if listed and listed[-1].severity is Severity.ERROR else []
    counts: Counter[tuple[str, Severity]] = Counter()
    log, left = DiagnosticLog(), _SHOWN_BYTES - sum(map(_size, end))
    for diagnostic in listed:
        shown = diagnostic.times == 1 and left > 0 and counts[diagnostic.code, diagnostic.severity] < _SHOWN
        if shown:
            left -= _size(diagnostic)
        counts[diagnostic.code, diagnostic.severity] += 1
        log.add(diagnostic, shown)
    return (*log, *end)


def totals(diagnostics: Iterable[Diagnostic]) -> dict[str, int]:
    """Return how often each code was found, the most frequent first."""
    counts: Counter[str] = Counter()
    for diagnostic in diagnostics:
        counts[diagnostic.code] += diagnostic.times
    return dict(sorted(counts.items(), key=lambda item: (-item[1], item[0])))


def _size(diagnostic: Diagnostic) -> int:
    return len(json.dumps(asdict(diagnostic)))


def _standing_for(first: Diagnostic, times: int, total: int) -> Diagnostic:
    span = first.span and replace(first.span, text="", skipped=0)
    message = f"{times} more findings of this code are not listed; {total} in all"
    return replace(first, message=message, hint="", span=span, times=times)
