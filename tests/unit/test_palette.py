"""Colours and lines of curves are told apart by all readers, and in print."""

import itertools
import math

import numpy as np
import pytest

from pgfmd.plots.drawing import LINES, PALETTE

# Of linear sRGB, for eyes without one kind of cone. Source: Machado, Oliveira and Fernandes 2009, severity 1.
EYES = {
    "all cones": np.eye(3),
    "deuteranopia": np.array(
        [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]]
    ),
    "protanopia": np.array(
        [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]]
    ),
}
TO_XYZ = np.array(
    [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]]
)
WHITE = np.array([0.95047, 1.0, 1.08883])


def linear(colour: str) -> np.ndarray:
    parts = np.array([int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)])
    return np.where(parts <= 0.04045, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4)


def lab(rgb: np.ndarray) -> np.ndarray:
    """L*, a*, b* of CIE 1976."""
    t = TO_XYZ @ np.clip(rgb, 0.0, 1.0) / WHITE
    x, y, z = np.where(t > 216 / 24389, np.cbrt(t), (24389 / 27 * t + 16) / 116)
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


@pytest.mark.parametrize("eyes", EYES)
def test_colours_are_told_apart(eyes):
    seen = [lab(EYES[eyes] @ linear(colour)) for colour in PALETTE]
    # A difference of 2 is just noticed side by side; thin lines need far more.
    assert min(math.dist(one, other) for one, other in itertools.combinations(seen, 2)) > 19.0


def test_prints_in_grey_keep_colours_apart():
    lightness = sorted(lab(linear(colour))[0] for colour in PALETTE)
    assert np.diff(lightness).min() > 8.0 and lightness[-1] < 80.0


def test_there_are_six_of_each():
    assert len(set(PALETTE)) == len(set(LINES)) == 6
