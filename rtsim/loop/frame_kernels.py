"""One compiled loop for every flight: live, replayed, in a batch, in a trial, in a search.

``advance`` is the frame, read from top to bottom. Its stages stand in ``observe_kernels`` and ``advance_kernels``; what
only some flights need (plant, pilot, law, aids, air, failures, automatic nacelles, script, measure) are parts, compiled
on their own and called at their address (``part_kernels``). A frame that needs a part which is not there yet is not
begun: the loop returns and says which, the caller compiles it and goes on.

Legend:
    entry: Address of ``fly_frames``.
    pilot_normals: Standard normals of the pilot's noise, one row per frame; shape (1, 0) without noise.
    air_normals: Standard normals of the air, one row per frame; shape (1, 0) without turbulence.
    rows: Written: the frames' rows, one after the other, frames * signals numbers; empty: they are not kept.
    frames: How many frames.
    stages: Stages of the first frame; the others are flown whole.
"""

from __future__ import annotations

from rtsim.arrays import FloatArray
from rtsim.atmosphere.gust_kernels import GUST
from rtsim.kernels.compiled import batch_kernel, inner_kernel, part
from rtsim.kernels.parts import call_at
from rtsim.loop.advance_kernels import (
    aid,
    ask,
    burn_fuel,
    disturb,
    fail,
    faults_act,
    follow_script,
    hold,
    judge_end,
    lateral_wakes,
    move_pilot,
    move_plant,
    move_reference,
    protect,
    record,
)
from rtsim.loop.data import CLOCK, END, MODE, PART, Flight
from rtsim.loop.observe_kernels import observe, sense
from rtsim.protection.law_data import LAW_OFF

OBSERVE, ASK, SCRIPT, LIMIT, COMPLETE, DISTURB, CONSULT = 1, 2, 4, 8, 16, 32, 64
"""Stages of a frame, which a caller may take one by one: observe; ask the pilot; let a script change what he gave; aids
and law; the rest. Besides: bring gusts and failures to the first frame; ask the MOCM whoever flies."""
WHOLE = OBSERVE | ASK | SCRIPT | LIMIT | COMPLETE


@inner_kernel
def advance(flight: Flight, stages: int, pilot_normals: FloatArray, air_normals: FloatArray) -> None:
    """Do the stages of one frame that are asked for.

    Args:
        stages: Which.
        pilot_normals: Standard normals of the pilot's noise in this frame; none: no noise.
        air_normals: Standard normals of the air.
    """
    if stages & DISTURB:
        disturb(flight, 0.0, air_normals)
    if stages & OBSERVE:
        observe(flight)
        sense(flight)
    if stages & CONSULT:
        call_at(flight.parts[PART.ask], flight)
    if stages & ASK:
        ask(flight)
    if stages & SCRIPT:
        follow_script(flight)
    if stages & LIMIT:
        aid(flight)
        protect(flight)
    if stages & COMPLETE:
        hold(flight)
        fail(flight)
        record(flight)
        move_pilot(flight, pilot_normals)
        move_plant(flight)
        move_reference(flight)
        disturb(flight, flight.tables.dt, air_normals)
        burn_fuel(flight)
        judge_end(flight)
        if flight.parts[PART.notice] != 0:
            call_at(flight.parts[PART.notice], flight)
        if flight.parts[PART.measure] != 0:
            call_at(flight.parts[PART.measure], flight)


@inner_kernel
def missing_part(flight: Flight) -> int:
    """Part that this frame needs and that has no address yet: 1 + its place in ``PART``; 0: none.

    Args:
        flight: The flight at the start of a frame.
    """
    tables, clock, parts = flight.tables, flight.state.clock, flight.parts
    if clock[CLOCK.mode] == MODE.external and parts[PART.aids] == 0:
        return 1 + PART.aids
    if tables.protection.law != LAW_OFF and parts[PART.decide] == 0:
        return 1 + PART.decide
    if parts[PART.ask_lateral] == 0 and clock[CLOCK.mode] == MODE.mocm and lateral_wakes(flight):
        return 1 + PART.ask_lateral
    if parts[PART.ask_lateral] != 0 and parts[PART.advance_lateral] == 0:
        return 1 + PART.advance_lateral
    if flight.state.gusts[GUST.busy] != 0.0 and parts[PART.air] == 0:
        return 1 + PART.air
    if faults_act(flight) and parts[PART.faults] == 0:
        return 1 + PART.faults
    return 0


@part
def fly_frames(
    flight: Flight, rows: FloatArray, pilot_normals: FloatArray, air_normals: FloatArray, frames: int, stages: int
) -> float:
    """Fly frames until there are no more, the flight ends, or a part is missing.

    Returns:
        How many frames were begun, and finished where their last stage was asked for; where a part was missing for the
        next one, -1 less that number.
    """
    clock = flight.state.clock
    noisy, rough, kept = pilot_normals.shape[1] > 0, air_normals.shape[1] > 0, rows.shape[0] > 0
    for k in range(frames):
        if stages & COMPLETE and clock[CLOCK.end] != END.none:
            return float(k)
        clock[CLOCK.missing] = float(missing_part(flight))
        if clock[CLOCK.missing] != 0.0:
            return float(-1 - k)
        advance(flight, stages, pilot_normals[k if noisy else 0], air_normals[k if rough else 0])
        if kept and stages & COMPLETE:
            row = flight.scratch.row
            for column in range(row.shape[0]):
                rows[k * row.shape[0] + column] = row[column]
        stages = WHOLE
    return float(frames)


@batch_kernel
def fly_unlocked(
    entry: int,
    flight: Flight,
    rows: FloatArray,
    pilot_normals: FloatArray,
    air_normals: FloatArray,
    frames: int,
    stages: int,
) -> float:
    """``fly_frames`` at its address, outside Python's lock, so that threads fly side by side."""
    return call_at(entry, flight, rows, pilot_normals, air_normals, frames, stages)
