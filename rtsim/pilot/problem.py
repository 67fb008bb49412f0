"""The pilot-model design problem: its data, defaults and the refusal of impossible values.

Symbols follow the literature on the optimal control model (NASA CR-163593, CR-177943):
``xdot = A x + B delta + E w``, ``y = C x + D delta``, white ``w`` of two-sided intensity ``W``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from rtsim.arrays import FloatArray
from rtsim.errors import InputError

PadeKind = Literal["pade", "taylor"]

REFUSAL_CODES = (
    "E_DIM",
    "E_NONFINITE",
    "E_TAU",
    "E_TAU_N",
    "E_TAU_N_UNREACHABLE",
    "E_PADE",
    "E_ATTENTION",
    "E_NOISE_RATIO",
    "E_THRESHOLD",
    "E_WEIGHT",
    "E_NO_EXCITATION",
    "E_NOT_STABILISABLE",
    "E_NOT_DETECTABLE",
    "E_NOT_WEIGHTED",
    "E_REMNANT_DIVERGES",
    "E_NO_CONVERGENCE",
)
"""Every reason for which a design is refused."""

DEFAULT_MOTOR_NOISE_RATIO = 10.0**-2.5
"""-25 dB, NASA CR-163593."""


class MocmError(InputError):
    """A pilot design that cannot be made; ``code`` names the reason (one of ``REFUSAL_CODES``)."""

    def __init__(
        self,
        code: str,
        problem: str,
        *,
        file: str | None = None,
        key: str | None = None,
        value: object = None,
        allowed: str | None = None,
        mend: str | None = None,
    ) -> None:
        """Compose the sentence.

        Args:
            code: The reason, one of ``REFUSAL_CODES``.
            problem: What is wrong, in a few words without full stop.
            key: The field at fault.
            value: The offending value.
            allowed: The allowed range or choices, in words.
            mend: What to do about it, as an imperative.
        """
        self.code = code
        self.reason = problem
        super().__init__(f"{problem} [{code}]", file=file, key=key, value=value, allowed=allowed, mend=mend)

    def located(self, *, file: str, table: str) -> MocmError:
        """Say the same with the place in a file.

        Args:
            file: The file.
            table: The table in which the field stands.

        Returns:
            The error with file and full key.
        """
        key = f"{table}.{self.key}" if self.key else table
        return MocmError(
            self.code, self.reason, file=file, key=key, value=self.value, allowed=self.allowed, mend=self.mend
        )


@dataclass(frozen=True, slots=True)
class MocmProblem:
    """A complete, checked design problem; make one with `build_problem`.

    n states, nu controls, ny displays, nw disturbances.
    """

    A: FloatArray
    """Plant dynamics (n, n)."""
    B: FloatArray
    """Controls (n, nu)."""
    C: FloatArray
    """Displays (ny, n)."""
    D: FloatArray
    """Feed-through of the controls to the displays (ny, nu)."""
    E: FloatArray
    """Disturbances (n, nw)."""
    W: FloatArray
    """Intensity of the white disturbances (nw, nw)."""
    q_y: FloatArray
    """Weights of the squared displays (ny,)."""
    q_u: FloatArray
    """Weights of the squared controls before the delay (nu,)."""
    tau: FloatArray
    """Pilot's delay of each control [s] (nu,)."""
    pade_order: int
    """Order of the delay's approximation: 0 (no delay), 1 or 2."""
    pade_kind: PadeKind
    """Second order: "pade" (true Pade) or "taylor" (truncated series, as TM-4384 prints it)."""
    tau_n: FloatArray | None
    """Neuromotor lag wanted of each control [s] (nu,); None where ``g`` is given."""
    g: FloatArray | None
    """Weights of the squared control rates (nu,); None where ``tau_n`` is given."""
    rho_y: FloatArray
    """Observation noise ratio of each display at full attention (ny,)."""
    f: FloatArray
    """Attention to each display, 0..1 (ny,)."""
    groups: tuple[int, ...] | None
    """Instrument of each display, or None: each its own, without the sum rule."""
    threshold: FloatArray
    """Half width of each display's indifference zone (ny,)."""
    rho_u: FloatArray
    """Motor noise ratio of each control (nu,)."""
    freq: FloatArray
    """Frequencies at which the pilot's transfer matrix is reported [rad/s]."""

    @property
    def attended(self) -> npt.NDArray[np.intp]:
        """Numbers of the displays that get attention."""
        return np.flatnonzero(self.f > 0.0)


FIELDS = (
    "A", "B", "C", "D", "E", "W", "q_y", "q_u", "tau", "pade_order", "pade_kind", "tau_n", "g", "rho_y", "f", "groups",
    "threshold", "rho_u", "freq",
)  # fmt: skip
"""Fields of a problem, as in the case files."""


def _numbers(fields: Mapping[str, object], key: str, *, dimensions: tuple[int, ...]) -> FloatArray:
    """Read one field as a float array of one of the given numbers of dimensions."""
    try:
        raw = np.asarray(fields[key])
        if raw.dtype.kind not in "iuf":
            raise TypeError
        array = np.array(raw, dtype=np.float64)
    except (TypeError, ValueError):
        raise MocmError("E_DIM", "is not a rectangular array of numbers", key=key) from None
    if array.ndim not in dimensions:
        names = " or ".join({0: "a number", 1: "a vector", 2: "a matrix"}[d] for d in dimensions)
        raise MocmError("E_DIM", f"has {array.ndim} dimensions", key=key, allowed=names)
    return array


def _matrix(fields: Mapping[str, object], key: str, *, rows: int | None, columns: int | None) -> FloatArray:
    """Read a required matrix and check its shape; None leaves a size free."""
    if fields.get(key) is None:
        raise MocmError("E_DIM", "is missing", key=key, mend=f"give the matrix {key}")
    array = _numbers(fields, key, dimensions=(2,))
    wanted = (rows if rows is not None else array.shape[0], columns if columns is not None else array.shape[1])
    if array.shape != wanted or 0 in array.shape:
        raise MocmError("E_DIM", f"has shape {array.shape}", key=key, allowed=f"{wanted}, not empty")
    return array


def _vector(fields: Mapping[str, object], key: str, *, size: int, default: float | None) -> FloatArray:
    """Read a vector; one element (or a plain number) stands for all its channels."""
    if fields.get(key) is None:
        if default is None:
            raise MocmError("E_DIM", "is missing", key=key, mend=f"give the vector {key}")
        return np.full(size, default)
    array = np.atleast_1d(_numbers(fields, key, dimensions=(0, 1)))
    if array.size not in (1, size):
        raise MocmError("E_DIM", f"has {array.size} elements", key=key, allowed=f"1 or {size}")
    return np.array(np.broadcast_to(array, (size,)), dtype=np.float64)


def _intensity(fields: Mapping[str, object], disturbances: int) -> FloatArray:
    """Read W: a matrix, a vector of its diagonal, or the identity where it is omitted."""
    if fields.get("W") is None:
        return np.eye(disturbances)
    array = _numbers(fields, "W", dimensions=(0, 1, 2))
    if array.ndim < 2:
        return np.diag(_vector(fields, "W", size=disturbances, default=None))
    return _matrix(fields, "W", rows=disturbances, columns=disturbances)


def _groups(fields: Mapping[str, object], displays: int) -> tuple[int, ...] | None:
    """Read the instrument number of each display."""
    raw = fields.get("groups")
    if raw is None:
        return None
    values = _numbers(fields, "groups", dimensions=(1,))
    if values.size != displays:
        raise MocmError("E_DIM", f"has {values.size} elements", key="groups", allowed=str(displays))
    if not np.all(np.isfinite(values)) or np.any(values != np.round(values)):
        raise MocmError("E_DIM", "is not a list of instrument numbers", key="groups", allowed="whole numbers")
    return tuple(int(value) for value in values)


def _pade(fields: Mapping[str, object]) -> tuple[int, PadeKind]:
    """Read order and kind of the delay's approximation."""
    order, kind = fields.get("pade_order"), fields.get("pade_kind")
    order = 2 if order is None else order
    kind = "pade" if kind is None else kind
    if isinstance(order, bool) or not isinstance(order, (int, np.integer)) or order not in (0, 1, 2):
        raise MocmError("E_PADE", "is not an order that is known", key="pade_order", value=order, allowed="0, 1 or 2")
    if kind == "pade":
        return int(order), "pade"
    if kind == "taylor":
        return int(order), "taylor"
    raise MocmError("E_PADE", "is not a kind that is known", key="pade_kind", value=kind, allowed='"pade", "taylor"')


def build_problem(fields: Mapping[str, object]) -> MocmProblem:
    """Check a design problem and fill in its defaults.

    Omitted are taken: D = 0, W = identity, q_u = 0, tau = 0.2 s, pade_order = 2, pade_kind = "pade",
    rho_y = 0.01, f = 1, threshold = 0, rho_u = 10^-2.5. A one-element vector stands for all its channels.

    Args:
        fields: Values by field name, as in ``FIELDS``; exactly one of ``tau_n`` and ``g`` is given.

    Returns:
        The checked problem, its arrays read-only.

    Raises:
        MocmError: A value is impossible; its code says in which way.
        InputError: A field is not known.
    """
    unknown = sorted(set(fields) - set(FIELDS))
    if unknown:
        raise InputError("is not a field of a pilot design", key=unknown[0], allowed=", ".join(FIELDS))
    a = _matrix(fields, "A", rows=None, columns=None)
    states = a.shape[0]
    if a.shape[1] != states:
        raise MocmError("E_DIM", f"has shape {a.shape}", key="A", allowed="a square matrix")
    b = _matrix(fields, "B", rows=states, columns=None)
    c = _matrix(fields, "C", rows=None, columns=states)
    e = _matrix(fields, "E", rows=states, columns=None)
    displays, controls = c.shape[0], b.shape[1]
    d = np.zeros((displays, controls))
    if fields.get("D") is not None:
        d = _matrix(fields, "D", rows=displays, columns=controls)
    order, kind = _pade(fields)
    given = {key: fields.get(key) is not None for key in ("tau_n", "g")}
    freq = fields.get("freq")
    problem = MocmProblem(
        A=a,
        B=b,
        C=c,
        D=d,
        E=e,
        W=_intensity(fields, e.shape[1]),
        q_y=_vector(fields, "q_y", size=displays, default=None),
        q_u=_vector(fields, "q_u", size=controls, default=0.0),
        tau=_vector(fields, "tau", size=controls, default=0.2),
        pade_order=order,
        pade_kind=kind,
        tau_n=_vector(fields, "tau_n", size=controls, default=None) if given["tau_n"] else None,
        g=_vector(fields, "g", size=controls, default=None) if given["g"] else None,
        rho_y=_vector(fields, "rho_y", size=displays, default=0.01),
        f=_vector(fields, "f", size=displays, default=1.0),
        groups=_groups(fields, displays),
        threshold=_vector(fields, "threshold", size=displays, default=0.0),
        rho_u=_vector(fields, "rho_u", size=controls, default=DEFAULT_MOTOR_NOISE_RATIO),
        freq=np.array([0.3, 1.0, 3.0, 10.0]) if freq is None else _numbers(fields, "freq", dimensions=(1,)),
    )
    _check_values(problem)
    for name in FIELDS:
        value = getattr(problem, name)
        if isinstance(value, np.ndarray):
            value.flags.writeable = False
    return problem


def _check_values(problem: MocmProblem) -> None:
    """Refuse values that have no meaning, each with its code."""
    for key in FIELDS:
        value = getattr(problem, key)
        if isinstance(value, np.ndarray) and not np.all(np.isfinite(value)):
            raise MocmError("E_NONFINITE", "contains NaN or infinity", key=key)
    if np.any(problem.tau < 0.0):
        raise MocmError("E_TAU", "is negative", key="tau", value=problem.tau.tolist(), allowed=">= 0 s")
    if (problem.tau_n is None) == (problem.g is None):
        raise MocmError("E_TAU_N", "the lag is not fixed", key="tau_n", mend="give exactly one of tau_n and g")
    if problem.tau_n is not None and np.any(problem.tau_n <= 0.0):
        raise MocmError("E_TAU_N", "is not positive", key="tau_n", value=problem.tau_n.tolist(), allowed="> 0 s")
    if np.any(problem.rho_y <= 0.0):
        raise MocmError("E_NOISE_RATIO", "is not positive", key="rho_y", value=problem.rho_y.tolist(), allowed="> 0")
    if np.any(problem.rho_u < 0.0):
        raise MocmError("E_NOISE_RATIO", "is negative", key="rho_u", value=problem.rho_u.tolist(), allowed=">= 0")
    if np.any(problem.threshold < 0.0):
        raise MocmError("E_THRESHOLD", "is negative", key="threshold", value=problem.threshold.tolist(), allowed=">= 0")
    if np.any(problem.freq <= 0.0):
        raise MocmError("E_DIM", "is not positive", key="freq", value=problem.freq.tolist(), allowed="> 0 rad/s")
    _check_attention(problem)
    _check_weights(problem)
    _check_excitation(problem)


def _check_attention(problem: MocmProblem) -> None:
    f = problem.f
    if np.any((f < 0.0) | (f > 1.0)):
        raise MocmError("E_ATTENTION", "is outside its range", key="f", value=f.tolist(), allowed="0 to 1")
    if not np.any(f > 0.0):
        raise MocmError("E_ATTENTION", "no display gets attention", key="f", mend="give one display f > 0")
    if problem.groups is None:
        return
    shares: dict[int, float] = {}
    for group, share in zip(problem.groups, f, strict=True):
        if abs(shares.setdefault(group, float(share)) - share) > 1e-9:
            raise MocmError(
                "E_ATTENTION", f"displays of instrument {group} differ", key="f", value=f.tolist(),
                mend="give one share to all displays of an instrument",
            )  # fmt: skip
    total = sum(shares.values())
    if total > 1.0 + 1e-9:
        raise MocmError(
            "E_ATTENTION", f"instruments sum to {total:.10g}", key="f", value=f.tolist(), allowed="sum <= 1"
        )


def _check_weights(problem: MocmProblem) -> None:
    for key in ("q_y", "q_u"):
        if np.any(getattr(problem, key) < 0.0):
            raise MocmError("E_WEIGHT", "is negative", key=key, value=getattr(problem, key).tolist(), allowed=">= 0")
    if not np.any(problem.q_y > 0.0):
        raise MocmError("E_WEIGHT", "all are zero", key="q_y", mend="weight one display")
    if problem.g is not None and np.any(problem.g <= 0.0):
        raise MocmError("E_WEIGHT", "is not positive", key="g", value=problem.g.tolist(), allowed="> 0")


def _check_excitation(problem: MocmProblem) -> None:
    w = problem.W
    scale = float(np.max(np.abs(w)))
    if not np.allclose(w, w.T, rtol=0.0, atol=1e-9 * scale):
        raise MocmError("E_DIM", "is not symmetric", key="W", allowed="a symmetric matrix, positive semidefinite")
    if scale > 0.0 and float(np.min(np.linalg.eigvalsh(0.5 * (w + w.T)))) < -1e-9 * scale:
        raise MocmError("E_NO_EXCITATION", "is no intensity: it has a negative eigenvalue", key="W", allowed=">= 0")
    if not np.any(problem.E @ w @ problem.E.T != 0.0):
        raise MocmError(
            "E_NO_EXCITATION", "nothing disturbs the plant, noise has no scale", key="W", mend="make E W E' > 0"
        )
