"""Random files that mean harm: floods of findings, huge words, long lists, wrong counts, broken columns."""

from __future__ import annotations

import random
from collections.abc import Callable

from scenes import box_mesh

BOX = "Boundary Box [-9:9;-9:9;-9:9]\nMultibodies\n"
ROBOT = "Active\n1\ncube.g Volumetric Rotational\nConnections\n0\n"
ROBOT_XML = (
    '<Robot><MultiBody type="active"><Base filename="cube.g" type="volumetric" movement="rotational"/></MultiBody>'
    "</Robot>"
)
# What stands beside each hostile file.
BESIDE = {"cube.g": box_mesh(0.5, 0.5, 0.5), "robot.xml": ROBOT_XML}

_WORDS = ("x", "Pasive", "\x1b[31m", "\u202e", "é", "😀", "a.g", "1e999", "-", "#", "'", "\\", "%n", "\x07", "nan")

Made = tuple[str, str]
"""Name and text of a file."""


def word(rng: random.Random, longest: int) -> str:
    """Return a word, now and then a very long one, that may hold anything but blanks."""
    return rng.choice(_WORDS) * rng.choice((1, 1, 3, rng.randrange(1, longest)))


def quoted(text: str) -> str:
    """Return text as the value of an XML attribute; XML has no control characters."""
    kept = "".join(c for c in text if c >= " ")
    return '"' + kept.replace("&", "&amp;").replace("<", "&lt;").replace('"', "&quot;") + '"'


def problem(inside: str) -> str:
    return f"<MotionPlanning><MPProblem><Environment/>{inside}</MPProblem></MotionPlanning>"


def unknown_tags(rng: random.Random, n: int) -> Made:
    tags = "".join(f"<Tag{i if rng.random() < 0.5 else ''} a={quoted(word(rng, 50))}/>" for i in range(n))
    return "hostile.xml", f"<Environment>{tags}</Environment>"


def unknown_attributes(rng: random.Random, n: int) -> Made:
    many = " ".join(f"a{i}={quoted(word(rng, 9))}" for i in range(n))
    body = f'<MultiBody type="passive" {many}><Base filename="cube.g" transform="0 0 0 0 0 0" {many}/></MultiBody>'
    return "hostile.xml", f"<Environment {many}>{body}</Environment>"


def misspelt_tags(rng: random.Random, n: int) -> Made:
    tags = ("Pasive", "Passiv", "pasive", "Passive")
    return "hostile.env", f"{BOX}{n}\n" + "".join(f"{rng.choice(tags)}\ncube.g 1 2 3 0 0 0\n" for _ in range(n // 8))


def missing_meshes(rng: random.Random, n: int) -> Made:
    names = (f"{word(rng, 90)}{i}.g".replace("#", "") for i in range(n // 4))
    return "hostile.env", f"{BOX}{n // 4}\n" + "".join(f"Passive\n{name} 1 2 3 0 0 0\n" for name in names)


def huge_words(rng: random.Random, n: int) -> Made:
    text: list[str] = f"{BOX}1\n{ROBOT}".split(" ")
    text[rng.randrange(len(text))] = word(rng, 2) * (50 * n)
    return "hostile.env", " ".join(text)


def huge_values(rng: random.Random, n: int) -> Made:
    long = quoted(f"{word(rng, 5)} " * 20 * n)
    return "hostile.xml", rng.choice(
        (
            f"<Environment><MultiBody type={long}/></Environment>",
            f'<Environment><MultiBody type="passive"><Base filename={long}/></MultiBody></Environment>',
            problem(f"<Robot label={long} filename={long}/>"),
            problem(f'<Robot label="r" filename="robot.xml"/><Task label={long} robot={long}/>'),
            f"<Environment>{long}</Environment>",
        )
    )


def many_robots(rng: random.Random, n: int) -> Made:
    count = max(3000, n)  # more than make as many pairs as a scene may have
    robots = "".join(f'<Robot label="r{i}" filename="robot.xml"/>' for i in range(count))
    point = '<StartConstraints><CSpaceConstraint point="0 0 0 0 0 0"/></StartConstraints>'
    tasks = "".join(f'<Task robot="r{i}">{point}</Task>' for i in range(count))
    return "hostile.xml", problem(robots + tasks)


def unknown_robot(rng: random.Random, n: int) -> Made:
    robots = "".join(f'<Robot label={quoted(word(rng, 40) + str(i))} filename="robot.xml"/>' for i in range(n))
    return "hostile.xml", problem(f"{robots}<Task robot={quoted(word(rng, 900))}/>")


def wrong_counts(rng: random.Random, n: int) -> Made:
    count = rng.choice((-1, 0, n, 10**9, 10**400))
    text = rng.choice((f"{BOX}{count}\n{ROBOT}", f"{BOX}1\n{ROBOT.replace('1', str(count), 1)}"))
    return "hostile.env", text


def long_line(rng: random.Random, n: int) -> Made:
    body = " Pasive cube.g 1 2 3 0 0 0"
    return "hostile.env", f"{BOX}{n // 8}".replace("\n", " ") + body * (n // 8) + " " * n + word(rng, n)


def nested(rng: random.Random, n: int) -> Made:
    depth = rng.choice((90, 99, 150, n))
    inside = f"<{'é' * rng.randrange(1, 99)}/>" * rng.randrange(n)
    return "hostile.xml", "<Environment>" + "<a>" * depth + inside + "</a>" * depth + "</Environment>"


def comments(rng: random.Random, n: int) -> Made:
    return "hostile.env", "".join(f"#{word(rng, 90)}\n" for _ in range(n)) + f"{BOX}1\n{ROBOT}"


def noise(rng: random.Random, n: int) -> Made:
    letters = "".join(map(chr, (*range(128), 0x202E, 0x1F600, 0xE9)))
    name = rng.choice(("hostile.env", "hostile.xml", "hostile.robot", "hostile.g", "hostile.obj", "hostile.dat"))
    head = rng.choice((BOX, "<Environment>", "1\n", "v 0 0 0\n", ""))
    return name, head + "".join(rng.choices(letters[rng.choice((0, 32)) :], k=n))


def columns(rng: random.Random, n: int) -> Made:
    """A BYU mesh whose numbers touch, in one width, in several, or with one number wrong."""
    integer, other = rng.choice((5, 6, 8, 10)), rng.choice((8, 10, 12, 16))
    digits = "".join(rng.choices("0123456789-. E", (9, *[3] * 9, 2, 2, 2, 1), k=integer * other * 40))
    lines = [digits[i : i + 120] for i in range(0, len(digits), 120)]
    header = rng.choice((f"{1:{integer}d}{3:{integer}d}{1:{integer}d}{3:{integer}d}", "1\n3\n1\n3"))
    ones = [rng.choice("12") * 2520] * (n // 500)
    return "hostile.g", "\n".join([header, *rng.choice((lines, ones, [".1111111" * 315] * (n // 500), ["1"] * n))])


def bodies_of_one_robot(rng: random.Random, n: int) -> Made:
    count = 2500  # more than make as many pairs as a scene may have
    joints = "".join(f"{rng.randrange(i + 1)} {i + 1} Revolute -1:1\n{'0 ' * 16}\n" for i in range(count - 1))
    bodies = "cube.g Volumetric Rotational\n" + "cube.g Joint\n" * (count - 1)
    return "hostile.env", f"{BOX}1\nActive\n{count}\n{bodies}Connections\n{count - 1}\n{joints}"


def resolutions(rng: random.Random, n: int) -> Made:
    lines = "".join(f"PositionRes {rng.choice((0, -1))}\n" for _ in range(n))
    return "hostile.env", BOX.replace("Multi", f"{lines}Multi") + f"1\n{ROBOT}"


KINDS: tuple[Callable[[random.Random, int], Made], ...] = (
    unknown_tags,
    unknown_attributes,
    misspelt_tags,
    missing_meshes,
    huge_words,
    huge_values,
    many_robots,
    unknown_robot,
    wrong_counts,
    long_line,
    nested,
    comments,
    noise,
    columns,
    bodies_of_one_robot,
    resolutions,
)
