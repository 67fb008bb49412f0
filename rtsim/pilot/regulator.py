"""The pilot's control law: optimal gains with weighted control rates, and the neuromotor lag they imply (M2-M5)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import LinAlgError

from rtsim.arrays import FloatArray
from rtsim.pilot.delay import DelayFilter, delay_filter
from rtsim.pilot.problem import MocmError, MocmProblem
from rtsim.pilot.riccati import RiccatiFailure, solve_lyapunov, solve_riccati

_LAG_TOLERANCE = 1e-11
_LAG_STEPS = 80
_LARGEST_STEP = 3.0
_SEARCH_RANGE = 90.0


@dataclass(frozen=True, slots=True)
class DelayedPlant:
    """Plant with the delay filter on its input, states [x; xd], input u_p (M2)."""

    A: FloatArray
    """Dynamics (ns, ns)."""
    B: FloatArray
    """Controls before the delay (ns, nu)."""
    C: FloatArray
    """Displays (ny, ns)."""
    D: FloatArray
    """Feed-through (ny, nu)."""
    E: FloatArray
    """Disturbances (ns, nw)."""
    delay: DelayFilter
    """The filter."""


@dataclass(frozen=True, slots=True)
class Regulator:
    """Gains of the control law ``T_n udot_p + u_p = -l [x; xd]``."""

    g: FloatArray
    """Weights of the squared control rates (nu,)."""
    G1: FloatArray
    """Gain from plant and delay states to the control rate (nu, ns)."""
    G2: FloatArray
    """Gain from the controls to their rates (nu, nu)."""
    T_n: FloatArray
    """Neuromotor lag matrix, inverse of G2 [s] (nu, nu)."""
    l: FloatArray  # noqa: E741  # the literature's symbol
    """Commanded-control gain T_n G1 (nu, ns)."""


def delayed_plant(problem: MocmProblem) -> DelayedPlant:
    """Put the pilot's delay in front of the plant.

    Args:
        problem: The design problem.

    Returns:
        The augmented plant.
    """
    delay = delay_filter(problem.tau, order=problem.pade_order, kind=problem.pade_kind)
    nd, nw = delay.A.shape[0], problem.E.shape[1]
    n = problem.A.shape[0]
    return DelayedPlant(
        A=np.block([[problem.A, problem.B @ delay.C], [np.zeros((nd, n)), delay.A]]),
        B=np.vstack([problem.B @ delay.D, delay.B]),
        C=np.hstack([problem.C, problem.D @ delay.C]),
        D=problem.D @ delay.D,
        E=np.vstack([problem.E, np.zeros((nd, nw))]),
        delay=delay,
    )


@dataclass(frozen=True, slots=True)
class RateRegulator:
    """The regulator problem with the controls as states and their rates as inputs (M3)."""

    A: FloatArray
    """Dynamics (n1, n1)."""
    B: FloatArray
    """Control rates (n1, nu)."""
    Q: FloatArray
    """State weight (n1, n1)."""
    weighted: FloatArray
    """Weighted outputs, ``weighted' weighted = Q`` (nq, n1)."""


def rate_regulator(problem: MocmProblem, plant: DelayedPlant) -> RateRegulator:
    """State the linear-quadratic problem of the control rates.

    Args:
        problem: The design problem.
        plant: Its plant with delay.

    Returns:
        Dynamics and weights.
    """
    ns, nu = plant.B.shape
    zero = np.zeros((nu, ns))
    weighted = np.vstack(
        [
            np.sqrt(problem.q_y)[:, None] * np.hstack([plant.C, plant.D]),
            np.sqrt(problem.q_u)[:, None] * np.hstack([zero, np.eye(nu)]),
        ]
    )
    return RateRegulator(
        A=np.block([[plant.A, plant.B], [zero, np.zeros((nu, nu))]]),
        B=np.vstack([zero.T, np.eye(nu)]),
        Q=weighted.T @ weighted,
        weighted=weighted,
    )


class _LagSearch:
    """Gains and lag as functions of log g, each solve warm-started from the last."""

    def __init__(self, system: RateRegulator, tau_n: FloatArray, gain: FloatArray | None) -> None:
        self.system, self.tau_n, self.gain = system, tau_n, gain

    def evaluate(self, log_g: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return log(T_ii / tau_n_i) (nu,) and its Jacobian with respect to log g (nu, nu)."""
        a, b, g = self.system.A, self.system.B, np.exp(log_g)
        nu = b.shape[1]
        _, gain = solve_riccati(a, b, self.system.Q, g, gain=self.gain)
        lag = np.linalg.inv(gain[:, -nu:])
        closed = (a - b @ gain).T
        jacobian = np.empty((nu, nu))
        for j in range(nu):
            # d/dlog g_j of the Riccati equation: one Lyapunov equation with the closed loop
            source = g[j] * np.outer(gain[j], gain[j])
            slope = (b.T @ solve_lyapunov(closed, source)) / g[:, None]
            slope[j] -= gain[j]
            jacobian[:, j] = -np.diag(lag @ slope[:, -nu:] @ lag) / np.diag(lag)
        self.gain = gain
        return np.log(np.diag(lag) / self.tau_n), jacobian


def _unreachable(tau_n: FloatArray, limit: float | None = None) -> MocmError:
    allowed = None if limit is None else f"< {limit:.4g} s, 1/(2 sum of the unstable poles)"
    return MocmError(
        "E_TAU_N_UNREACHABLE", "no control-rate weight gives this neuromotor lag", key="tau_n", value=tau_n.tolist(),
        allowed=allowed, mend="shorten tau_n or give g",
    )  # fmt: skip


def _solve_lag(problem: MocmProblem, system: RateRegulator, start: FloatArray, gain: FloatArray | None) -> FloatArray:
    """Find log g with diag(T_n) = tau_n by a damped Newton method (M5)."""
    tau_n = problem.tau_n
    assert tau_n is not None
    poles = np.linalg.eigvals(problem.A).real
    unstable = float(np.sum(poles[poles > 0.0]))
    if tau_n.size == 1 and unstable > 0.0 and float(tau_n[0]) >= 1.0 / (2.0 * unstable):
        raise _unreachable(tau_n, 1.0 / (2.0 * unstable))
    search = _LagSearch(system, tau_n, gain)
    log_g = start.copy()
    error, jacobian = search.evaluate(log_g)
    for _ in range(_LAG_STEPS):
        size = float(np.max(np.abs(error)))
        if size < _LAG_TOLERANCE:
            return log_g
        try:
            newton = -np.linalg.solve(jacobian, error)
        except np.linalg.LinAlgError:
            newton = -3.0 * error
        if not np.all(np.isfinite(newton)):
            newton = -3.0 * error
        newton *= min(1.0, _LARGEST_STEP / float(np.max(np.abs(newton))))
        for step in (newton, 0.5 * newton, 0.1 * newton, -np.clip(3.0 * error, -_LARGEST_STEP, _LARGEST_STEP)):
            try:
                trial_error, trial_jacobian = search.evaluate(log_g + step)
            except (RiccatiFailure, LinAlgError):  # weights so far apart that no gain is told from none
                raise _unreachable(tau_n) from None
            if float(np.max(np.abs(trial_error))) < size:
                break
        log_g, error, jacobian = log_g + step, trial_error, trial_jacobian
        if float(np.max(np.abs(error))) < 1e-9 and float(np.max(np.abs(error))) >= size:
            return log_g  # rounding is reached
        if float(np.max(np.abs(log_g - start))) > _SEARCH_RANGE:
            break
    raise _unreachable(tau_n)


def design_regulator(problem: MocmProblem, plant: DelayedPlant, *, start: Regulator | None = None) -> Regulator:
    """Solve for the pilot's gains; where ``tau_n`` is given, for the rate weights that produce it.

    Args:
        problem: The design problem.
        plant: Its plant with delay.
        start: Regulator of a neighbouring problem of the same sizes, to save time.

    Returns:
        Gains, rate weights and the full lag matrix.

    Raises:
        MocmError: E_TAU_N_UNREACHABLE, or E_NO_CONVERGENCE where no stabilizing gain is found.
    """
    system = rate_regulator(problem, plant)
    ns, nu = plant.B.shape
    gain = None if start is None else np.hstack([start.G1, start.G2])
    if gain is not None and np.max(np.linalg.eigvals(system.A - system.B @ gain).real) >= 0.0:
        gain = None
    try:
        if problem.g is not None:
            g = problem.g.copy()
        else:
            log_g = np.log(start.g) if start is not None else np.full(nu, _first_guess(problem, plant))
            g = np.exp(_solve_lag(problem, system, log_g, gain))
        _, gain = solve_riccati(system.A, system.B, system.Q, g, gain=gain)
    except (RiccatiFailure, LinAlgError) as failure:
        raise MocmError("E_NO_CONVERGENCE", f"no stabilizing gain was found ({failure})", key="q_y") from failure
    lag = np.asarray(np.linalg.inv(gain[:, ns:]), dtype=np.float64)
    return Regulator(g=g, G1=gain[:, :ns].copy(), G2=gain[:, ns:].copy(), T_n=lag, l=lag @ gain[:, :ns])


def _first_guess(problem: MocmProblem, plant: DelayedPlant) -> float:
    """Give the log g that balances display and control-rate costs for a slow step of the controls."""
    assert problem.tau_n is not None
    reach = np.linalg.norm(np.sqrt(problem.q_y)[:, None] * plant.C, ord=2) * np.linalg.norm(plant.B, ord=2)
    size = (float(reach) * float(np.mean(problem.tau_n)) ** 2) ** 2
    return float(np.log(max(size, 1e-12)))
