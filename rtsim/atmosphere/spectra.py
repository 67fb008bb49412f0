"""Analytic power spectra of the Dryden gusts (MIL-F-8785C 3.7.1.2, 3.7.1.4), for plots, design and tests."""

from __future__ import annotations

import math

import numpy as np

from rtsim.arrays import FloatArray


def longitudinal_spectrum(frequency: FloatArray, *, sigma: float, scale: float, speed: float) -> FloatArray:
    """One-sided spectrum of the gust from ahead: its integral from 0 is sigma squared.

    Args:
        frequency: Angular frequency, any shape [rad/s].
        sigma: Intensity [m/s].
        scale: Scale length [m].
        speed: Speed through the frozen field [m/s].

    Returns:
        The spectrum, same shape [(m/s)^2 s/rad].
    """
    reduced = scale * frequency / speed
    return np.asarray(sigma**2 * 2.0 * scale / (math.pi * speed) / (1.0 + reduced**2))


def vertical_spectrum(frequency: FloatArray, *, sigma: float, scale: float, speed: float) -> FloatArray:
    """One-sided spectrum of the gust from below: its integral from 0 is sigma squared.

    Args:
        frequency: Angular frequency, any shape [rad/s].
        sigma: Intensity [m/s].
        scale: Scale length [m].
        speed: Speed through the frozen field [m/s].

    Returns:
        The spectrum, same shape [(m/s)^2 s/rad].
    """
    reduced = scale * frequency / speed
    return np.asarray(sigma**2 * scale / (math.pi * speed) * (1.0 + 3.0 * reduced**2) / (1.0 + reduced**2) ** 2)


def pitch_spectrum(frequency: FloatArray, *, sigma: float, scale: float, speed: float, span: float) -> FloatArray:
    """One-sided spectrum of the pitch gust that goes with the gust from below.

    Args:
        frequency: Angular frequency, any shape [rad/s].
        sigma: Intensity of the gust from below [m/s].
        scale: Its scale length [m].
        speed: Speed through the frozen field [m/s].
        span: Wing span [m].

    Returns:
        The spectrum, same shape [(rad/s)^2 s/rad].
    """
    wave = frequency / speed
    gain = wave**2 / (1.0 + (4.0 * span * wave / math.pi) ** 2)
    return np.asarray(gain * vertical_spectrum(frequency, sigma=sigma, scale=scale, speed=speed))
