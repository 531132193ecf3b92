"""The creep law discretised in time by a diagonally implicit Runge-Kutta method.

    w = J_inf f + sum_m J_m phi_m,    lambda_m dphi_m/dt = f - phi_m

phi_m are the internal variables, w is the effective traction. Over one step h the stages obey
phi_i = phi_n + (h/lambda) sum_{j<=i} a_ij k_j with the rates k_j = f_j - phi_j. They are linear in phi_n and in the
tractions of the stages, so that each stage is a static problem w_i = J_i f_i + history_i:

    k_i       = rate_decay_i phi_n + sum_{j<=i} rate_gain_ij f_j            (per element m)
    history_i = sum_m branch_weight_im phi_nm + sum_{j<i} stage_weight_ij f_j
    phi_{n+1} = decay phi_n + sum_i gain_i f_i                              (per element m)

The recursion uses the rates, so that elements with lambda << h and lambda >> h lose no digits. The methods are L-stable
and stiffly accurate: the last stage is the end of the step, and an element much faster than the step is in equilibrium.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from pgfmd.physics.rheology import CreepSeries
from pgfmd.solver.trial_step import Trial

from .retardation_kernels import weights_of


@dataclass(frozen=True)
class Tableau:
    """A stiffly accurate, diagonally implicit method: matrix a (s, s), nodes c (s,), order, and its error constant.

    The local error is about `error_constant` h^(order + 1) times the derivative of that order.
    """

    a: tuple[tuple[float, ...], ...]
    order: int
    error_constant: float

    @cached_property
    def matrix(self) -> np.ndarray:
        """a as an array (s, s)."""
        return np.array(self.a)

    @property
    def nodes(self) -> tuple[float, ...]:
        """Times of the stages within the step, 0 ... 1."""
        return tuple(sum(row) for row in self.a)

    @property
    def stages(self) -> int:
        """Number of stages; each is one static problem."""
        return len(self.a)


_G = 1.0 - 1.0 / math.sqrt(2.0)
IMPLICIT_EULER = Tableau(((1.0,),), 1, 0.5)
SDIRK2 = Tableau(((_G, 0.0), (1.0 - _G, _G)), 2, abs(1.0 / 6.0 - 3.0 * _G**2 + 2.0 * _G**3))
"""Two stages, second order, L-stable (gamma = 1 - 1/sqrt(2))."""


@dataclass(frozen=True)
class StepWeights:
    """The weights of one step, with s stages and N elements."""

    compliance: np.ndarray  # J_i (s,)
    internal_weight: np.ndarray  # (s, N)
    stage_weight: np.ndarray  # (s, s), strictly lower
    decay: np.ndarray  # (N,)
    gain: np.ndarray  # (N, s)
    rate_decay: np.ndarray  # (N, s)
    rate_gain: np.ndarray  # (N, s, s), lower
    quadrature: np.ndarray  # (N, s): the dissipated energy is the sum of quadrature k_i G0 k_i


def step_weights(creep: CreepSeries, tableau: Tableau, step: float) -> StepWeights:
    """The weights for a step of `step` [s]."""
    return StepWeights(*weights_of(tableau.matrix, creep.J, creep.retardation_times, float(creep.J_inf), step))


@dataclass
class StagedTrial(Trial):
    """A trial step of several stages, with its weights."""

    weights: StepWeights = field(kw_only=True, repr=False)
