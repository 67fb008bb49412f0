"""The tree of random streams: one seed, independent generators for everything that draws numbers.

A stream is named by a number and, where it branches (a campaign's runs, say), by further numbers. The generator is a
PCG64 seeded by ``SeedSequence([seed, stream, *branch])``, the seed written as two 32-bit words: NumPy splits large
numbers into words, and without the fixed width ``[2**32 + 5, 0]`` would be the same sequence as ``[5, 1]``.
"""

from __future__ import annotations

import numpy as np

from rtsim.errors import InputError

STREAM_PILOT = 0
"""Motor and observation noise of the MOCM."""
STREAM_TURBULENCE = 1
"""White noise of the Dryden filters."""
STREAM_CAMPAIGN = 2
"""Draws of a campaign's specification; branches by class and run."""
STREAM_SEARCH = 3
"""Draws of the conversion-path search; branches by generation."""
STREAM_LATERAL_TURBULENCE = 4
"""White noise of the Dryden filters of side, roll and yaw: those of the others stay what they are."""
STREAM_LATERAL_PILOT = 5
"""Noise of the pilot's lateral half."""

LARGEST_SEED = 2**63 - 1
_WORD = 0xFFFFFFFF


def seed_sequence(seed: int, stream: int, *branch: int) -> np.random.SeedSequence:
    """Give the seed sequence of a stream.

    Args:
        seed: Root of the tree, 0 to 2**63 - 1.
        stream: Number of the stream, one of ``STREAM_*``, below 2**32.
        branch: Numbers of the branch within the stream, each below 2**32. Trailing zeros do not make a new branch, so
            a stream either always or never branches.

    Returns:
        The sequence; equal arguments give equal sequences on every machine.

    Raises:
        InputError: A number is out of range.
    """
    if not 0 <= seed <= LARGEST_SEED:
        raise InputError("is out of range", key="seed", value=seed, allowed=f"0 to {LARGEST_SEED}")
    for number in (stream, *branch):
        if not 0 <= number <= _WORD:
            raise InputError("is out of range", key="stream", value=number, allowed=f"0 to {_WORD}")
    return np.random.SeedSequence([seed & _WORD, seed >> 32, stream, *branch])


def stream_generator(seed: int, stream: int, *branch: int) -> np.random.Generator:
    """Give the generator of a stream, at its beginning.

    Args:
        seed: Root of the tree, 0 to 2**63 - 1.
        stream: Number of the stream, one of ``STREAM_*``.
        branch: Numbers of the branch within the stream.

    Raises:
        InputError: A number is out of range.
    """
    return np.random.Generator(np.random.PCG64(seed_sequence(seed, stream, *branch)))
