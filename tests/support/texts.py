"""Small scenes as text, one of each dialect, and a way to read them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import env2mjcf
from env2mjcf.errors import Diagnostic, Severity
from env2mjcf.model.environment import Environment

LEGACY = """#Environment Version 20020327
2
MultiBody Active
3
#VIZMO_COLOR 0.5 0.25 1
FreeBody 0 cube.g 1 2 3 10 20 30
FreeBody 1 link1.g
FreeBody 2 link2.g
Connection
2
0 1 Actuated
0.2 0 0 -90 0 0  90 0.3 0.4 30 Revolute 0.5 0 0 0 0 45
1 2 NonActuated
0.6 0 0 0 90 0  0 0.7 0.8 60 Prismatic 0.9 0 0 0 0 0
MultiBody Passive
1
FixedBody 0 wall.g 0 2 0 0 0 90
Connection
0
"""

LEGACY_FIXED = """1
MultiBody Active
2
FixedBody 0 base.g 1 2 3 0 0 90
FreeBody 0 link.g
Connection
1
0 1 Actuated
0 0 0 0 0 0  0 1 0 0 Revolute 0 0 0 0 0 0
"""

B = """2
Active
3
base.g Volumetric Rotational
link1.g Joint
link2.g Joint
Connections
2
0 1 Revolute
1 2 3 90 0 0  0.1 0.2 0.3 0.4  4 5 6 0 90 0
1 2 Spherical
0 0 0 0 0 0  0.5 0.6 0.7 0.8  0 0 0 0 0 0
Passive
wall.g 0 2 0 0 0 90
"""

C = """Boundary Box -10:10 -20:20 -30:30
Multibodies
2
Active
3
base.g Planar Rotational
link1.g Joint
link2.g Joint
Connections
2
0 1 Revolute -0.5:0.25
1 2 3 90 0 0  0.1 0.2 0.3 0.4  4 5 6 0 90 0
1 2 Spherical -1:1 -0.1:0.2
0 0 0 0 0 0  0.5 0.6 0.7 0.8  0 0 0 0 0 0
Passive
wall.g 0 2 0 0 0 90
"""

D = """# a comment in front
Boundary Box [-10:10 ; -20:20 ; -30:30]
PositionRes 0.05
Orientation 0.1
MultiBodies
4
Active
3
base.g -c(0 1 0 1) Fixed 1 2 3 0 0 90
link1.g -a(None) 2.5 Joint
link2.g -t(wood.png)-c(0 0 1 1) Joint
Adjacencies
1
0 2
Connections
2
0 1 Revolute -0.5:0.25
1 2 3 90 0 0  0.1 0.2 0.3 0.4  4 5 6 0 90 0
1 2 NonActuated
0 0 0 0 0 0  0.5 0.6 0.7 0.8  0 0 0 0 0 0
Active
1
ball.g Volumetric Translational
Connections
0
Internal
pillar.g -1 2 0 0 0 90
Surface floor
floor.g -c(0 0 0 1)-1.02 -3.54 0 0 0 0
"""

NON_HOLONOMIC = """Boundary Box [-10:10 ; -20:20 ; -30:30]
TimeRes 0.05
MultiBodies
2
Passive
wall.g 0 2 0 0 0 90
NonHolonomic
1
car.g 1.5 Planar Rotational
Connections
0
VelocityBounds 2 0.5
Controls 3
1 0 0
0 0.5 0.25
-1 0 0
"""

E = """Boundary Box [-10:10 ; -20:20 ; -30:30]
PositionRes 0.05
MultiBodies
2
Passive
wall.g -c(0 0 1 1) 0 2 0 0 0 90
Internal
pillar.g Fixed 1 2 3 0 0 0
"""

ROBOT = """3
base.g -c(0 1 0 1) Planar Translational
link1.g Joint
link2.g Joint
Adjacencies
1
0 2
Connections
2
1 2 Revolute -1:1
1 2 3 90 0 0  0.1 0.2 0.3 0.4  4 5 6 0 90 0
0 1 Spherical -0.5:0.25 0:1
0 0 0 0 0 0  0.5 0.6 0.7 0.8  0 0 0 0 0 0
"""

XML_ENVIRONMENT = """<?xml version="1.0" encoding="UTF-8"?>
<Environment positionRes="0.02" orientationRes="0.1" gravity="0 0 0">
  <Boundary space="workspace" shape="box" limits="[-2:2 ; -3:3 ; -0.1:2.5]"/>
  <MultiBody type="passive">
    <Base filename="table.g" comAdjustment="com" color="0.8 0.7 0.5 1" type="fixed" transform="1 0 0.15 0 0 90"/>
  </MultiBody>
  <MultiBody type="internal">
    <Base filename="can.g" type="fixed" transform="0.85 0.4 0.4 0 0 0"/>
  </MultiBody>
</Environment>
"""

XML_ROBOT = """<?xml version="1.0"?>
<Robot>
  <MultiBody type="active">
    <Base filename="base.g" type="planar" movement="rotational" mass="3"/>
    <Link index="1" filename="link1.g" type="joint">
      <Connection parentIndex="0" childIndex="1" joint="revolute" range="-0.5:0.25"
        transformParentToDH="1 2 3 90 0 0" initialDHParams="0.1 0.2 0.3 0.4" transformDHToChild="4 5 6 0 90 0"/>
    </Link>
    <Link index="2" filename="link2.g" type="joint">
      <Connection parentIndex="0" childIndex="2" joint="spherical" range="-1:1" range2="0:1"
        transformParentToDH="0 0 0 0 0 0" initialDHParams="0 0 0 0" transformDHToChild="0 0 0 0 0 0"/>
    </Link>
  </MultiBody>
</Robot>
"""

PROBLEM = """<?xml version="1.0"?>
<MotionPlanning>
  <Problem baseFilename="x">
    <Environment filename="scene.env"/>
    <Robot label="rob" filename="rob.robot"/>
    <Task label="go" robot="rob">
      <StartConstraints><CSpaceConstraint point="1 2 0.1 0.2 0.3"/></StartConstraints>
      <GoalConstraints><CSpaceConstraint point="3 4 0.4 0.5 0.6"/></GoalConstraints>
    </Task>
  </Problem>
  <Library>
    <CollisionDetection label="rapid" ignoreAdjacentLinks="true" ignoreSelfCollision="false"/>
  </Library>
</MotionPlanning>
"""

ENV_TEXTS = {"A": LEGACY, "A-fixed": LEGACY_FIXED, "B": B, "C": C, "D": D, "D-nonholonomic": NON_HOLONOMIC, "E": E}

Reader = Callable[..., Environment]


@pytest.fixture
def read(tmp_path: Path) -> Reader:
    """Read a text as if it were a file called `scene.env`."""

    def read_text(text: str | bytes, name: str = "scene.env", **options: Any) -> Environment:
        path = write(tmp_path, text, name)
        return env2mjcf.read(path, **options)

    return read_text


@pytest.fixture
def read_robot(tmp_path: Path) -> Reader:
    """Read a text as a robot file, beside a small environment of dialect E."""

    def read_text(text: str, **options: Any) -> Environment:
        robot = write(tmp_path, text, "rob.xml" if text.lstrip().startswith("<") else "rob.robot")
        return env2mjcf.read(write(tmp_path, E, "scene.env"), robots=[robot], **options)

    return read_text


def write(folder: Path, text: str | bytes, name: str) -> Path:
    """Write a text byte by byte, so that its line ends stay."""
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def codes(scene: Environment) -> list[str]:
    """Codes of a scene's warnings."""
    return [d.code for d in warnings(scene)]


def warnings(scene: Environment) -> list[Diagnostic]:
    """A scene's warnings."""
    return [d for d in scene.diagnostics if d.severity is Severity.WARNING]


def fault(read: Reader, text: str | bytes, **options: Any) -> Diagnostic:
    """Read what cannot be read, and return why; whatever it is, it says where, and what to do."""
    with pytest.raises(env2mjcf.Env2MjcfError) as caught:
        read(text, **options)
    found = caught.value.diagnostic
    assert found.hint, f"{found.message} has no hint"
    if found.span is not None:
        assert str(found.span) in str(caught.value)
    return found


def place(text: str, word: str, occurrence: int = 1) -> tuple[int, int]:
    """Line and column, from 1, of the n-th occurrence of a word."""
    at = -1
    for _ in range(occurrence):
        at = text.index(word, at + 1)
    before = text[:at]
    return before.count("\n") + 1, at - (before.rfind("\n") + 1) + 1
