"""Critically damped second-order filter of a ramp, in closed form: no integration error at any step size.

It is the conversion actuator (3 rad/s, the paper's second-order filter of the nacelle command) and the airspeed
reference's filter (1.5 rad/s).
"""

from __future__ import annotations

from math import exp

from rtsim.kernels.compiled import inner_kernel


@inner_kernel
def critically_damped_ramp(
    frequency: float, command: float, command_rate: float, value: float, value_rate: float, elapsed: float
) -> tuple[float, float, float]:
    """Value, rate and acceleration of the filter a time after its state was known.

    With w the frequency, c the command and r its rate, y'' = w^2 (c + r t - y) - 2 w y' has the solution
    y = c + r t - 2 r / w + (e + k t) exp(-w t), where e = y(0) - c + 2 r / w and k = y'(0) - r + w e.

    Args:
        frequency: Natural frequency [rad/s].
        command: Command at the start.
        command_rate: Its constant rate [1/s].
        value: Filter output at the start.
        value_rate: Its rate at the start [1/s].
        elapsed: Time since the start [s].
    """
    w = frequency
    lag = 2.0 * command_rate / w
    e = value - command + lag
    d = value_rate - command_rate
    k = d + w * e
    decay = exp(-w * elapsed)
    return (
        command + command_rate * elapsed - lag + (e + k * elapsed) * decay,
        command_rate + (d - w * k * elapsed) * decay,
        -w * (k + d - w * k * elapsed) * decay,
    )
