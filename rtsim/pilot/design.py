"""Design of a pilot (Modified Optimal Control Model) for any linear plant."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
import numpy.typing as npt

from rtsim.arrays import ComplexArray, FloatArray
from rtsim.errors import InputError, suggestion
from rtsim.pilot.estimator import Estimator, InternalModel, design_estimator, internal_model
from rtsim.pilot.modes import check_modes
from rtsim.pilot.problem import DEFAULT_MOTOR_NOISE_RATIO, MocmError, MocmProblem, PadeKind, build_problem
from rtsim.pilot.regulator import DelayedPlant, Regulator, delayed_plant, design_regulator, rate_regulator
from rtsim.pilot.response import Margins, PilotSystem, closed_loop, frequency_response, pilot_margins, pilot_system

if TYPE_CHECKING:
    import control

    Plant: TypeAlias = control.StateSpace | Sequence[npt.ArrayLike] | MocmProblem


@dataclass(frozen=True, slots=True)
class Statistics:
    """Root-mean-square values in the design's disturbances, and the cost they make."""

    rms_y: FloatArray
    """Displays (ny,)."""
    rms_delta: FloatArray
    """Controls after the delay (nu,)."""
    rms_u_p: FloatArray
    """Controls before the delay (nu,)."""
    rms_u_c: FloatArray
    """Commanded controls, before the neuromotor lag (nu,)."""
    rms_udot: FloatArray
    """Control rates T_n^-1 (u_c - u_p), motor noise left out (nu,)."""
    cost: float
    """Weighted sum of the variances."""
    remnant_fraction: FloatArray
    """Share of the pilot's own noise in the variances of displays and delayed controls (ny + nu,)."""


@dataclass(frozen=True, slots=True)
class MocmDesign:
    """A designed pilot."""

    problem: MocmProblem
    """What was asked."""
    plant: DelayedPlant
    """Plant with the delay filter on its input."""
    regulator: Regulator
    """Gains, rate weights and neuromotor lag."""
    model: InternalModel
    """The pilot's internal model."""
    estimator: Estimator
    """Filter and self-consistent noises."""
    statistics: Statistics
    """RMS values and cost."""

    @property
    def l_plant(self) -> FloatArray:
        """Commanded-control gain on the plant's states (nu, n)."""
        return self.regulator.l[:, : self.problem.A.shape[0]]

    @property
    def F_plant(self) -> FloatArray:  # noqa: N802 - the name in case files
        """Filter gain of the plant's states (n, ny)."""
        return self.estimator.F[: self.problem.A.shape[0]]

    @property
    def pilot(self) -> PilotSystem:
        """The pilot as a linear system from displays to delayed controls."""
        return pilot_system(self.model, self.plant, self.regulator, self.estimator)

    def transfer_matrix(self, frequencies: FloatArray) -> ComplexArray:
        """Pilot transfer matrix Yp(jw) from displays to delayed controls.

        Args:
            frequencies: w [rad/s] (k,).

        Returns:
            The response (k, nu, ny).
        """
        pilot = self.pilot
        return frequency_response(pilot.A, pilot.B, pilot.C, None, frequencies)

    def margins(self) -> Margins:
        """Crossover and margins of each control, opened with the others closed."""
        return pilot_margins(self.problem, self.pilot)

    def closed_loop_poles(self) -> ComplexArray:
        """Eigenvalues of plant and pilot together [rad/s]."""
        system = closed_loop(self.problem, self.model, self.plant, self.regulator, self.estimator)
        return np.asarray(np.linalg.eigvals(system.A), dtype=np.complex128)


def design_problem(problem: MocmProblem, *, start: MocmDesign | None = None) -> MocmDesign:
    """Solve a checked design problem.

    Args:
        problem: What is asked.
        start: Design of a neighbouring problem of the same sizes, to save time.

    Returns:
        The pilot.

    Raises:
        MocmError: No pilot can be designed; the code says why.
    """
    plant = delayed_plant(problem)
    system = rate_regulator(problem, plant)
    keep = np.concatenate([problem.q_y, problem.q_u]) > 0.0
    check_modes(
        a=problem.A,
        b=problem.B,
        attended=problem.C[problem.attended],
        regulator=system.A,
        weighted=system.weighted[keep],
    )
    regulator = design_regulator(problem, plant, start=start.regulator if start else None)
    model = internal_model(plant, regulator)
    estimator = design_estimator(problem, model, start=start.estimator if start else None)
    return MocmDesign(
        problem=problem,
        plant=plant,
        regulator=regulator,
        model=model,
        estimator=estimator,
        statistics=_statistics(problem, plant, regulator, model, estimator),
    )


def _statistics(
    problem: MocmProblem, plant: DelayedPlant, regulator: Regulator, model: InternalModel, estimator: Estimator
) -> Statistics:
    """Variances from the covariances of estimate and error (M10) and the remnant's share (M13)."""
    nu, ns = problem.B.shape[1], plant.A.shape[0]
    covariance = estimator.Xh + estimator.S
    # rate of the control without motor noise: T_n^-1 (u_c - u_p), u_c from the estimate, u_p the true state
    from_estimate, from_state = -regulator.G2 @ model.l, np.zeros((nu, ns + nu))
    from_state[:, ns:] = -regulator.G2
    total = from_estimate + from_state

    def variance(rows: FloatArray, matrix: FloatArray) -> FloatArray:
        return np.asarray(np.maximum(np.einsum("ij,jk,ik->i", rows, matrix, rows), 0.0))

    rate = variance(total, estimator.Xh) + variance(from_state, estimator.S)
    controls = np.zeros((nu, ns + nu))
    controls[:, ns:] = np.eye(nu)
    delayed = np.hstack([np.zeros((nu, problem.A.shape[0])), plant.delay.C, plant.delay.D])
    var_y, var_u_p = variance(model.C, covariance), variance(controls, covariance)
    loop = closed_loop(problem, model, plant, regulator, estimator)
    full, remnant = loop.variances(), loop.variances(remnant_only=True)
    cost = problem.q_y @ var_y + problem.q_u @ var_u_p + regulator.g @ rate
    return Statistics(
        rms_y=np.sqrt(var_y),
        rms_delta=np.sqrt(variance(delayed, covariance)),
        rms_u_p=np.sqrt(var_u_p),
        rms_u_c=np.sqrt(variance(model.l, estimator.Xh)),
        rms_udot=np.sqrt(rate),
        cost=float(cost),
        remnant_fraction=np.divide(remnant, full, out=np.zeros_like(full), where=full > 0.0),
    )


def _pick(labels: list[str], wanted: object, key: str) -> list[int]:
    """Turn signal names or numbers into numbers; one name or number stands for a list of it."""
    if wanted is None:
        return list(range(len(labels)))
    numbers = []
    for item in [wanted] if isinstance(wanted, (str, int, np.integer)) else _entries(wanted, key):
        if isinstance(item, str) and item in labels:
            numbers.append(labels.index(item))
        elif isinstance(item, (int, np.integer)) and not isinstance(item, bool) and 0 <= int(item) < len(labels):
            numbers.append(int(item))
        else:
            mend = suggestion(item, labels, otherwise="name one") if isinstance(item, str) else "name one"
            raise InputError("is not a signal of the plant", key=key, value=item, allowed=", ".join(labels), mend=mend)
    if len(set(numbers)) < len(numbers):
        raise InputError("names a signal twice", key=key, value=wanted, mend="name each once")
    return numbers


def _entries(wanted: object, key: str) -> list[object]:
    try:
        return list(wanted)  # type: ignore[call-overload, no-any-return]
    except TypeError:
        mend = "give a list of names or numbers"
        raise InputError("is no list of signals", key=key, value=wanted, mend=mend) from None


def _plant_arrays(plant: Plant, controls: object, disturbances: object, displays: object) -> dict[str, object]:
    """Split a plant into the fields A, B, C, D and, where its inputs hold disturbances, E."""
    if isinstance(plant, (tuple, list)):
        if len(plant) not in (3, 4):
            raise MocmError("E_DIM", "is neither (A, B, C) nor (A, B, C, D)", key="plant", value=len(plant))
        arrays = [_real(part, name) for part, name in zip(plant, "ABCD", strict=False)]
        a, b, c = arrays[:3]
        d = arrays[3] if len(arrays) == 4 else np.zeros((c.shape[0], b.shape[1]))
        inputs, outputs = [str(i) for i in range(b.shape[1])], [str(i) for i in range(c.shape[0])]
    else:
        system: Any = plant
        if not all(hasattr(system, name) for name in (*"ABCD", "input_labels", "output_labels")):
            raise MocmError(
                "E_DIM", f"is a {type(plant).__name__}", key="plant",
                allowed="control.StateSpace, arrays (A, B, C[, D]), or a MocmProblem",
                mend="give a state space model (control.ss makes one of a transfer function)",
            )  # fmt: skip
        if getattr(plant, "dt", 0) not in (0, None):
            raise MocmError("E_DIM", "is sampled", key="plant", mend="give a continuous-time plant")
        a, b, c, d = (_real(getattr(system, name), name) for name in "ABCD")
        inputs, outputs = list(system.input_labels), list(system.output_labels)
    if d.shape != (c.shape[0], b.shape[1]) or len(b) != len(a) or c.shape[1] != len(a) or a.shape[0] != a.shape[1]:
        shapes = ", ".join(str(matrix.shape) for matrix in (a, b, c, d))
        raise MocmError("E_DIM", f"has matrices that do not fit together: {shapes}", key="plant")
    rows = _pick(outputs, displays, "displays")
    noise = [] if disturbances is None else _pick(inputs, disturbances, "disturbances")
    hands = [i for i in _pick(inputs, controls, "controls") if controls is not None or i not in noise]
    if noise and np.any(d[np.ix_(rows, noise)] != 0.0):
        raise MocmError(
            "E_DIM", "a display shows a white disturbance directly", key="disturbances",
            mend="put a shaping filter in front of it",
        )  # fmt: skip
    fields: dict[str, object] = {"A": a, "B": b[:, hands], "C": c[rows], "D": d[np.ix_(rows, hands)]}
    if noise:
        fields["E"] = b[:, noise]
    return fields


def _real(value: Any, name: str) -> FloatArray:
    """A matrix of real numbers."""
    try:
        array = np.asarray(value)
        if array.dtype.kind not in "iuf":
            raise TypeError
        matrix = np.atleast_2d(array.astype(np.float64))
    except (TypeError, ValueError):
        raise MocmError("E_DIM", "is not a rectangular array of real numbers", key=f"plant {name}") from None
    if matrix.ndim != 2:
        raise MocmError("E_DIM", f"has {matrix.ndim} dimensions", key=f"plant {name}", allowed="a matrix")
    return matrix


def design_mocm(
    plant: Plant,
    *,
    controls: str | int | Sequence[str | int] | None = None,
    disturbances: str | int | Sequence[str | int] | None = None,
    displays: str | int | Sequence[str | int] | None = None,
    disturbance_matrix: npt.ArrayLike | None = None,
    disturbance_intensity: npt.ArrayLike | None = None,
    display_weights: npt.ArrayLike = 1.0,
    control_weights: npt.ArrayLike = 0.0,
    delay: npt.ArrayLike = 0.2,
    pade_order: int = 2,
    pade_kind: PadeKind = "pade",
    neuromotor_lag: npt.ArrayLike | None = None,
    control_rate_weights: npt.ArrayLike | None = None,
    display_noise_ratio: npt.ArrayLike = 0.01,
    attention: npt.ArrayLike = 1.0,
    instruments: Sequence[int] | None = None,
    threshold: npt.ArrayLike = 0.0,
    motor_noise_ratio: npt.ArrayLike = DEFAULT_MOTOR_NOISE_RATIO,
    start: MocmDesign | None = None,
) -> MocmDesign:
    """Design a pilot for a linear plant.

    Signals are deviations from trim. One number (or one-element vector) stands for all channels.

    Args:
        plant: A ``control.StateSpace`` (continuous time), arrays (A, B, C[, D]), or a checked `MocmProblem`.
        controls: Names or numbers of the inputs that are the pilot's, or one; default all that are no disturbances.
        disturbances: Names or numbers of the inputs that are white disturbances.
        displays: Names or numbers of the outputs the pilot sees; default all.
        disturbance_matrix: E (n, nw), where the disturbances are no inputs of ``plant``.
        disturbance_intensity: W (nw, nw), two-sided intensity; default identity.
        display_weights: Weights of the squared displays, often 1 / maximum^2.
        control_weights: Weights of the squared controls.
        delay: The pilot's delay [s].
        pade_order: Order of its approximation: 0 (none), 1 or 2.
        pade_kind: "pade", or "taylor" for the truncated series.
        neuromotor_lag: Lag of each hand [s]; default 0.1 unless rate weights are given.
        control_rate_weights: Weights of the squared control rates, instead of ``neuromotor_lag``.
        display_noise_ratio: Observation noise ratio at full attention (0.01 is -20 dB).
        attention: Share of attention of each display, 0..1.
        instruments: Instrument number of each display; the shares of instruments then sum to at most 1.
        threshold: Half width of each display's indifference zone.
        motor_noise_ratio: Motor noise ratio (-25 dB).
        start: Design of a neighbouring plant of the same sizes, to save time.

    Returns:
        The pilot: gains, filter, noises, statistics, margins.

    Raises:
        MocmError: No pilot can be designed; ``code`` names the reason.
        InputError: A signal name is not known.
    """
    if start is not None and not isinstance(start, MocmDesign):
        raise InputError("is no design of a pilot", key="start", value=start, mend="give what design_mocm returned")
    if isinstance(plant, MocmProblem):
        return design_problem(plant, start=start)
    fields = _plant_arrays(plant, controls, disturbances, displays)
    if disturbance_matrix is not None:
        fields["E"] = disturbance_matrix
    if neuromotor_lag is None and control_rate_weights is None:
        neuromotor_lag = 0.1
    fields |= {
        "W": disturbance_intensity,
        "q_y": display_weights,
        "q_u": control_weights,
        "tau": delay,
        "pade_order": pade_order,
        "pade_kind": pade_kind,
        "tau_n": neuromotor_lag,
        "g": control_rate_weights,
        "rho_y": display_noise_ratio,
        "f": attention,
        "groups": instruments,
        "threshold": threshold,
        "rho_u": motor_noise_ratio,
    }
    return design_problem(build_problem(fields), start=start)
