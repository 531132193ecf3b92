"""Linear viscoelasticity: the modulus ratio kappa as a Prony series, and the same law in its creep form.

    kappa(s)   = 1 + sum_n kappa_n s tau_n / (1 + s tau_n)          kappa = E(s)/E(0), s = i omega     (Maxwell form)
    1/kappa(s) = J_inf + sum_m J_m / (1 + s lambda_m)               exactly the same function          (creep form)

The number of elements N is the same in both, all quantities are positive, and the times interlace:
lambda_1 > tau_1 > lambda_2 > tau_2 > ... The creep form lets the history act on the traction, point by point; see the
section "Reproducing viscoelastic properties using GFMD" of the paper for the Maxwell form.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

# Two elements whose times differ by a relative epsilon respond like one at the mean time up to epsilon**2, so closer
# pairs than this are one element in double precision; kept apart they would only cost accuracy in `to_maxwell`.
MERGE_TOLERANCE = 1e-8
NORMALISATION_TOLERANCE = 1e-9


def _positive_series(weight_name: str, weights: ArrayLike, times: ArrayLike) -> tuple[Array, Array]:
    """Check, sort (longest time first), merge and freeze the weights and times of a series; both of shape (N,)."""
    weights = np.atleast_1d(np.array(weights, dtype=float))
    times = np.atleast_1d(np.array(times, dtype=float))
    if weights.ndim != 1 or weights.shape != times.shape:
        raise ValueError(f"{weight_name} and times need the same length, got shapes {weights.shape} and {times.shape}")
    if not (np.all(np.isfinite(weights)) and np.all(weights >= 0)):
        raise ValueError(f"every {weight_name} must be finite and >= 0, got {weights.tolist()}")
    if not (np.all(np.isfinite(times)) and np.all(times > 0)):
        raise ValueError(f"every time must be finite and > 0 (seconds), got {times.tolist()}")
    order = np.argsort(-times, kind="stable")
    order = order[weights[order] > 0]
    weights, times = weights[order], times[order]
    if times.size > 1:
        # A group is measured from its longest member, so that a fine ladder of times can't collapse into one.
        starts = [0]
        for index in range(1, times.size):
            if times[starts[-1]] - times[index] > MERGE_TOLERANCE * times[starts[-1]]:
                starts.append(index)
        offset = np.repeat(times[starts], np.diff([*starts, times.size])) - times
        total = np.add.reduceat(weights, starts)
        times, weights = times[starts] - np.add.reduceat(weights * offset, starts) / total, total
    weights.flags.writeable = False
    times.flags.writeable = False
    return weights, times


def _secular_roots(constant: float, strengths: Array, poles: Array) -> tuple[Array, Array, Array]:
    """Zeros t of constant + sum_n strengths_n / (poles_n - t), one above each pole (constant > 0) or between poles (0).

    `poles` (M,) ascending, `strengths` (M,) positive. Returns the roots t_k, ascending, shape (K,), K = M or M - 1,
    the differences poles_n - t_k, shape (K, M), and t_j - t_k, shape (K, K), all free of cancellation.
    The function rises from -inf to +inf between poles. The unknown is the distance to the nearer pole, bisected in
    its logarithm: a root can sit 1e-18 of its size away from a pole, and the weights of the other form are made of
    that distance. A dense symmetric eigensolver is accurate relative to the largest root only and fails here.
    """
    if poles.size == 0 or (constant == 0 and poles.size == 1):
        return np.empty(0), np.empty((0, poles.size)), np.empty((0, 0))
    separation = poles[None, :] - poles[:, None]
    count = poles.size if constant > 0 else poles.size - 1
    # Above the last pole: constant * distance <= sum of strengths.
    reach = np.append(np.diff(poles) / 2, strengths.sum() / constant if constant > 0 else [])

    def value(origin: NDArray[np.intp], signed: Array) -> Array:
        found: Array = constant + np.sum(strengths / (separation[origin] - signed[:, None]), axis=1)
        return found

    lower_pole = np.arange(count)
    in_upper_half = (value(lower_pole, reach) < 0) & (lower_pole < poles.size - 1)
    origin = np.where(in_upper_half, lower_pole + 1, lower_pole)
    sign = np.where(in_upper_half, -1.0, 1.0)
    # Within half an interval every other pole is at least half its separation from `origin` away.
    with np.errstate(divide="ignore"):
        others = np.where(separation == 0, 0.0, 2 * strengths[None, :] / np.abs(separation))
    high = reach.copy()
    low = 0.5 * np.minimum((strengths / (constant + others.sum(axis=1)))[origin], high)
    while True:
        middle = np.sqrt(low) * np.sqrt(high)
        undecided = (middle > low) & (middle < high)
        if not np.any(undecided):
            break
        beyond = sign * value(origin, sign * middle) > 0
        high = np.where(undecided & beyond, middle, high)
        low = np.where(undecided & ~beyond, middle, low)
    signed = sign * middle
    between_roots = separation[origin][:, origin] + (signed[None, :] - signed[:, None])
    return poles[origin] + signed, separation[origin] - signed[:, None], between_roots


def _residues(to_poles: Array, to_roots: Array) -> Array:
    """|prod_n (poles_n - t_k)| / |prod_{j != k} (t_j - t_k)|, shape (K,): the strengths of the reciprocal function.

    Loewner's formula. Unlike the reciprocal slope it belongs exactly to the roots as found: where two of them nearly
    coincide and their distances to the pole between are uncertain, the errors cancel in the response.
    """
    own = np.abs(np.diagonal(to_poles))
    ratio = np.abs(to_poles) / (np.abs(to_roots) + np.diag(own))
    found: Array = own * np.prod(ratio, axis=1)
    return found


@dataclass(frozen=True, eq=False)
class PronySeries:
    """kappa(s) = 1 + sum_n kappa_n s tau_n / (1 + s tau_n): modulus relative to the static one.

    kappa: weights E_n/E(0), dimensionless, shape (N,), >= 0; zeros are dropped.
    tau: relaxation times in s, shape (N,), > 0; times equal to 1e-8 are merged. Stored longest first.
    Raises ValueError for negative, non-finite or mismatched input.
    """

    kappa: Array
    tau: Array

    def __post_init__(self) -> None:
        kappa, tau = _positive_series("kappa", self.kappa, self.tau)
        object.__setattr__(self, "kappa", kappa)
        object.__setattr__(self, "tau", tau)

    @classmethod
    def elastic(cls) -> Self:
        """No relaxation at all: kappa = 1."""
        return cls(np.empty(0), np.empty(0))

    @classmethod
    def single(cls, modulus_ratio: float, relaxation_time: float) -> Self:
        """One element (standard linear solid): modulus_ratio = E(inf)/E(0) >= 1, relaxation_time in s."""
        return cls.geometric(modulus_ratio, relaxation_time, elements=1, time_ratio=2.0, exponent=0.0)

    @classmethod
    def geometric(
        cls, modulus_ratio: float, shortest_time: float, elements: int, time_ratio: float, exponent: float
    ) -> Self:
        """The paper's ladder: kappa_{n+1} = s**beta kappa_n, tau_{n+1} = tau_n/s; s = time_ratio, beta = exponent.

        modulus_ratio: E(inf)/E(0) >= 1, so sum kappa_n = modulus_ratio - 1; shortest_time: tau_N in s;
        elements: N >= 1; time_ratio: > 1. In between, E' grows about like omega**beta (for beta below 2).
        """
        if not (np.isfinite(modulus_ratio) and modulus_ratio >= 1):
            raise ValueError(f"modulus_ratio must be finite and >= 1 (E(inf)/E(0)), got {modulus_ratio}")
        if int(elements) != elements or elements < 1:
            raise ValueError(f"elements must be a whole number >= 1, got {elements}")
        if not (np.isfinite(time_ratio) and time_ratio > 1):
            raise ValueError(f"time_ratio must be finite and > 1 (tau_n / tau_(n+1)), got {time_ratio}")
        if not np.isfinite(exponent):
            raise ValueError(f"exponent must be finite, got {exponent}")
        # Floats throughout: whole-number powers of a whole number such as 6 overflow 64 bits from 6**25 on.
        ladder = float(time_ratio) ** np.arange(int(elements) - 1.0, -1.0, -1.0)
        weights = ladder**-exponent
        return cls((modulus_ratio - 1) * weights / weights.sum(), shortest_time * ladder)

    @property
    def elements(self) -> int:
        """Number N of distinct elements."""
        return self.kappa.size

    @property
    def kappa_inf(self) -> float:
        """E(inf)/E(0) = 1 + sum kappa_n."""
        return 1.0 + float(self.kappa.sum())

    def kappa_of(self, omega: ArrayLike) -> NDArray[np.complex128]:
        """Complex modulus ratio at angular frequency omega (rad/s), same shape as omega; loss is positive."""
        return self.storage(omega) + 1j * self.loss(omega)

    def storage(self, omega: ArrayLike) -> Array:
        """Storage modulus over E(0): 1 + sum kappa_n x^2/(1 + x^2), x = omega tau_n; same shape as omega (rad/s)."""
        x = np.multiply.outer(np.asarray(omega, dtype=float), self.tau)
        found: Array = 1.0 + (x**2 / (1 + x**2)) @ self.kappa
        return found

    def loss(self, omega: ArrayLike) -> Array:
        """Loss modulus over E(0): sum kappa_n x/(1 + x^2), x = omega tau_n; same shape as omega (rad/s)."""
        x = np.multiply.outer(np.asarray(omega, dtype=float), self.tau)
        found: Array = (x / (1 + x**2)) @ self.kappa
        return found

    def relaxation(self, time: ArrayLike) -> Array:
        """Stress after a strain step at time 0, over the static one: 1 + sum kappa_n exp(-t/tau_n); 0 for t < 0."""
        time = np.asarray(time, dtype=float)
        decay = np.exp(-np.multiply.outer(np.maximum(time, 0), 1 / self.tau))
        return np.where(time < 0, 0.0, 1.0 + decay @ self.kappa)

    def creep(self, time: ArrayLike) -> Array:
        """Strain after a stress step at time 0 (s), over the static one: `CreepSeries.creep` of `to_creep`."""
        return self.to_creep().creep(time)

    def to_creep(self) -> CreepSeries:
        """The exact creep form of the same law, N retardation times, relative accuracy about 1e-14.

        With t = -1/s, kappa = 1 + sum kappa_n tau_n/(tau_n - t) = prod (lambda_m - t)/(tau_m - t): its zeros are the
        retardation times, and lambda_m J_m is the residue of 1/kappa.
        """
        tau = self.tau[::-1]
        strengths = (self.kappa * self.tau)[::-1]
        times, to_poles, to_roots = _secular_roots(1.0, strengths, tau)
        weights = _residues(to_poles, to_roots) / times
        return CreepSeries(1 / self.kappa_inf, weights[::-1], times[::-1])


@dataclass(frozen=True, eq=False)
class CreepSeries:
    """1/kappa(s) = J_inf + sum_m J_m/(1 + s lambda_m), J_inf + sum J_m = 1: compliance relative to the static one.

    J_inf: instantaneous compliance over the static one, in (0, 1].
    J: weights, shape (N,), > 0. retardation_times: lambda_m in s, shape (N,), > 0. Stored longest first.
    Raises ValueError for negative, non-finite, mismatched input or weights that don't add to 1.
    """

    J_inf: float
    J: Array
    retardation_times: Array

    def __post_init__(self) -> None:
        weights, times = _positive_series("J", self.J, self.retardation_times)
        J_inf = float(self.J_inf)
        if not 0 < J_inf <= 1 + NORMALISATION_TOLERANCE:
            raise ValueError(f"J_inf must lie in (0, 1], got {self.J_inf}")
        if abs(J_inf + weights.sum() - 1) > NORMALISATION_TOLERANCE:
            raise ValueError(f"J_inf + sum J must be 1 (static compliance), got {J_inf + weights.sum()!r}")
        object.__setattr__(self, "J_inf", J_inf)
        object.__setattr__(self, "J", weights)
        object.__setattr__(self, "retardation_times", times)

    @property
    def elements(self) -> int:
        """Number N of distinct elements."""
        return self.J.size

    def compliance_of(self, omega: ArrayLike) -> NDArray[np.complex128]:
        """Complex compliance ratio 1/kappa(i omega) at angular frequency omega (rad/s), same shape as omega."""
        x = np.multiply.outer(np.asarray(omega, dtype=float), self.retardation_times)
        found: NDArray[np.complex128] = self.J_inf + (1 / (1 + 1j * x)) @ self.J
        return found

    def creep(self, time: ArrayLike) -> Array:
        """Strain after a stress step at time 0, over the static one.

        J_inf + sum J_m (1 - exp(-t/lambda_m)) for t >= 0 (s), 0 before; same shape as `time`.
        """
        time = np.asarray(time, dtype=float)
        growth = -np.expm1(-np.multiply.outer(np.maximum(time, 0), 1 / self.retardation_times))
        return np.where(time < 0, 0.0, self.J_inf + growth @ self.J)

    def relaxation(self, time: ArrayLike) -> Array:
        """Stress after a strain step at time 0 (s), over the static one: `PronySeries.relaxation` of `to_maxwell`."""
        return self.to_maxwell().relaxation(time)

    def storage(self, omega: ArrayLike) -> Array:
        """Storage modulus over E(0), as `PronySeries.storage`; same shape as omega (rad/s)."""
        return self.to_maxwell().storage(omega)

    def loss(self, omega: ArrayLike) -> Array:
        """Loss modulus over E(0), as `PronySeries.loss`; same shape as omega (rad/s)."""
        return self.to_maxwell().loss(omega)

    def to_maxwell(self) -> PronySeries:
        """The exact Maxwell form of the same law. Inverse of `PronySeries.to_creep`.

        With t = -1/s, (1/kappa)/t = J_inf/t + sum J_m/(t - lambda_m): J_inf is the strength of one more pole, at 0.
        Relaxation times a relative epsilon apart lose 1e-16/epsilon of their separate weights; kappa(omega) doesn't.
        """
        poles = np.concatenate([[0.0], self.retardation_times[::-1]])
        J = np.concatenate([[self.J_inf], self.J[::-1]])
        times, to_poles, to_roots = _secular_roots(0.0, J, poles)
        weights = _residues(to_poles[:, 1:], to_roots) / times
        return PronySeries(weights[::-1], times[::-1])
