"""Bodies that slide over flat faces made of many polygons: seams between cells must not be felt."""

from __future__ import annotations

import numpy as np
import pytest
from slides import NOISES, SLIDERS, Slide, all_slides


@pytest.mark.parametrize("name", ["notched", "stool", "blunt 160"])
def test_a_body_keeps_its_speed_and_course_over_the_seams_of_a_flat_face(name: str) -> None:
    slide = Slide("frictionless", name, 1e-5, 0.8, 0.6)
    _, velocity, _ = slide.run("plate")
    assert velocity[0] == pytest.approx(slide.speed, rel=1e-3)
    assert np.abs(velocity[1:]).max() < 1e-3


def test_a_step_of_a_millimetre_is_felt() -> None:
    """What the test above would see if seams were felt."""
    _, velocity, _ = Slide("frictionless", "notched", 0.0, 0.8, 0.6, step=1e-3).run("plate")
    assert velocity[0] < 0.59


@pytest.mark.slow
@pytest.mark.parametrize("noise", NOISES)
@pytest.mark.parametrize("name", SLIDERS)
def test_no_slide_loses_what_a_flat_face_would_not_take(name: str, noise: float) -> None:
    """A thousandth where nothing rubs; three thousandths of the way with friction, where bodies lean into seams."""
    slides = [s for s in all_slides() if (s.name, s.noise) == (name, noise) and "both" not in s.kind]
    assert len(slides) == 12
    for slide in slides:
        assert slide.lost() < (3e-3 if "friction" in slide.kind.split() else 1e-3), slide


@pytest.mark.slow
@pytest.mark.parametrize("noise", NOISES)
def test_a_robot_that_slides_over_another_keeps_its_speed(noise: float) -> None:
    """Wholly where the plate is written first; else it is MuJoCo's second geom, whose lips turn normals a little."""
    slides = [s for s in all_slides() if s.noise == noise and s.kind.startswith("both move")]
    assert len(slides) == 36
    for slide in slides:
        expected = 1e-3 if slide.kind == "both move, plate first" else 1e-2 if noise < 1e-4 else 2e-2
        assert slide.lost() < expected, slide
