"""A rigid sinusoid held in full contact with a viscoelastic surface by the paper's cohesive law.

Where the gap g is negative the law is linear, traction f = K0 g with K0 = Gamma''(0) = pi^2 gamma/(2 rho^2). The punch
d(t) + A (1 + cos q x) excites two modes only. The cell is periodic with u(q=0) = 0, so the mean gap is d + A and the
mean traction follows the motion at once. The wave obeys f_q = K0 (A - u_q) with u_q = G0 f_q/kappa(s), G0 = 2/(q E*):

    f_q(s) = K0 A / (1 + b/kappa(s)),   b = K0 G0.

1 + b/kappa = (1 + b) times another creep series (J_inf' = (1 + b J_inf)/(1 + b), J_m' = b J_m/(1 + b), the same
lambda_m), so f_q(t) after contact at t = 0 is K0 A/(1 + b) times the relaxation function of that series. A is constant
in time, hence the amplitude doesn't depend on d(t) as long as the contact stays complete. No discretisation in time
or space is involved.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgfmd.physics.rheology import CreepSeries, PronySeries


def contact_relaxation(coupling: float, creep: CreepSeries) -> PronySeries:
    """kappa'(s) = (1 + b)/(1 + b/kappa(s)) as a Prony series, with b = K0 G0 (dimensionless) = `coupling`."""
    scale = 1 + coupling
    shifted = CreepSeries((1 + coupling * creep.J_inf) / scale, coupling * creep.J / scale, creep.retardation_times)
    return shifted.to_maxwell()


def full_contact_sinusoid(
    time: ArrayLike,
    position: ArrayLike,
    amplitude: float,
    wave_number: float,
    contact_modulus: float,
    stiffness: float,
    creep: CreepSeries,
    start: str = "instantaneous",
) -> tuple[NDArray, NDArray]:
    """Mean traction and amplitude of the cos(q x) traction (Pa, pulling up positive), both of the shape of `time`.

    time: s since the contact was made, >= 0, any shape; position: d(t) (m), same shape, negative when pushed in.
    amplitude: A (m) of z = A (1 + cos q x); wave_number: q (rad/m); contact_modulus: static E* (Pa).
    stiffness: K0 (Pa/m). creep: the rheology. start: "instantaneous" (no memory at time 0: the surface answers
    with its high-frequency modulus) or "equilibrium" (relaxed, constant amplitude).
    The force on the punch per area is minus the mean traction. Raises ValueError where the gap would not be negative
    everywhere, since the law is linear only there.
    """
    t = np.asarray(time, dtype=float)
    mean = stiffness * (np.asarray(position, dtype=float) + amplitude) * np.ones_like(t)
    if start not in ("instantaneous", "equilibrium"):
        raise ValueError(f"start must be 'instantaneous' or 'equilibrium', got {start!r}")
    if np.any(t < 0):
        raise ValueError("time must be >= 0, the contact is made at 0")
    coupling = 2 * stiffness / (wave_number * contact_modulus)
    wave = np.full_like(t, stiffness * amplitude / (1 + coupling))
    if start == "instantaneous":
        wave = wave * contact_relaxation(coupling, creep).relaxation(t)
    if np.any(mean + np.abs(wave) >= 0):
        raise ValueError("the gap is not negative everywhere at every time: push in further (position more negative)")
    return mean, wave
