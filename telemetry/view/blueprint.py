"""How the views are laid out when the viewer opens: for the pilot, the engineer, replay, two flights compared."""

from __future__ import annotations

from typing import Any

import rerun as rr
import rerun.blueprint as rrb

from telemetry.log.signal_groups import plot_groups
from telemetry.view import cockpit, ground_map
from telemetry.view import corridor as rerun_corridor
from telemetry.view import instruments as rerun_instruments
from telemetry.view.colours import BACKGROUND
from telemetry.view.options import Layout
from telemetry.view.overlay import COMPARED
from telemetry.view.plots import PILOT_PLOTS

SHOWN_SECONDS = 30.0
"""Length of the time histories that follow the flight [s]."""


ENGINEER_TABS: dict[str, tuple[str, ...]] = {
    "Controls, rotors": ("flapping", "controls", "rotor"),
    "Loads, power": (),
    "Attitude, course": ("attitude", "course"),
    "Speed, place": ("speed", "nacelle", "altitude", "position"),
    "Corridor, protection": ("corridor", "protection"),
    "Air, failures": ("air", "wind", "failures"),
    "Loop health": ("loop",),
}
"""Tabs of the engineer's layout and the groups of signals in each; the first takes those that are nowhere else."""


def blueprint(layout: Layout, *, replay: bool = False) -> Any:
    """The layout of that name.

    Args:
        layout: ``pilot``, ``cockpit`` (the same from the seat), ``engineer`` or ``compare``.
        replay: What is shown has been flown: play it from its start, with curves over all of it.
    """
    if layout == "compare":
        content = _compare()
    elif layout == "engineer":
        content = _engineer(follow=not replay)
    else:
        content = _pilot(follow=not replay, cockpit_first=layout == "cockpit")
    state: Any = "Playing" if replay else "Following"
    time_panel = rrb.TimePanel(state="collapsed", timeline="sim_time", play_state=state)
    return rrb.Blueprint(
        content,
        time_panel,
        rrb.SelectionPanel(state="hidden"),
        rrb.BlueprintPanel(state="hidden"),
        rrb.TopPanel(state="hidden"),
        auto_views=False,
        auto_layout=False,
    )


def _compare() -> Any:
    """Two flights: window and corridor on the left; on the right what each did, and the difference beside it."""
    plots = []
    for number, (name, (title, _, unit)) in enumerate(COMPARED.items()):
        names: dict[str, Any] = {"legend": not number, "corner": "RightBottom"}
        plots.append(_time_series(f"compare/{name}", f"{title} [{unit}]", follow=False, **names))
        plots.append(_time_series(f"difference/{name}", f"B less A [{unit}]", follow=False, legend=False))
    apart = _time_series("difference/apart", "Apart [m]", follow=False, legend=False)
    below = rrb.Horizontal(_corridor(bare=True), rrb.Tabs(apart, _events(), _map(), _modes(follow=False)))
    left = rrb.Vertical(rrb.Tabs(_chase(away=1.7), _cockpit(), active_tab=0), below, row_shares=[1.1, 1.0])
    side_by_side = rrb.Grid(*plots, grid_columns=2, name="Side by side")
    right = rrb.Tabs(side_by_side, _instruments(), active_tab=0)
    return rrb.Horizontal(left, right, column_shares=[1.25, 1.0])


def _pilot(*, follow: bool, cockpit_first: bool) -> Any:
    """Window, corridor and instruments large; map, events, plots and states one behind the other."""
    plots = [_time_series(path, title, follow=follow) for path, (title, _) in PILOT_PLOTS.items()]
    behind = rrb.Tabs(_map(), _events(), rrb.Grid(*plots, grid_columns=2, name="Plots"), _modes(follow=follow))
    below = rrb.Horizontal(_corridor(bare=True), behind)
    left = rrb.Vertical(_flight(cockpit_first=cockpit_first), below, row_shares=[1.1, 1.0])
    return rrb.Horizontal(left, _instruments(), column_shares=[1.38, 1.0])


def _engineer(*, follow: bool) -> Any:
    """Plots of every signal in tabs of few enough to be read, beside corridor and aircraft."""
    groups = plot_groups()
    elsewhere = {group for tab in ENGINEER_TABS.values() for group in tab}

    def grid(name: str, names: tuple[str, ...]) -> Any:
        chosen = [
            group
            for group in groups
            if _group_of(group.path) in names or (not names and _group_of(group.path) not in elsewhere)
        ]
        views = [
            _time_series(group.path, group.title, follow=follow, legend=len(group.columns) > 1) for group in chosen
        ]
        return rrb.Grid(*views, grid_columns=2 if len(views) < 7 else 3, name=name)

    told = rrb.Tabs(_events(), _modes(follow=follow), active_tab=0)
    left = rrb.Vertical(rrb.Tabs(_corridor(), _map()), _flight(), told, row_shares=[4.0, 3.0, 2.2])
    tabs = rrb.Tabs(*(grid(name, names) for name, names in ENGINEER_TABS.items()), active_tab=0)
    return rrb.Horizontal(left, tabs, column_shares=[1.0, 2.2])


def _flight(*, cockpit_first: bool = False) -> Any:
    """The flight from behind the aircraft and from the pilot's seat, one behind the other."""
    return rrb.Tabs(_chase(), _cockpit(), active_tab=int(cockpit_first))


def _chase(*, away: float = 1.0) -> Any:
    """From behind the aircraft; farther away where another one is to be seen, too."""
    eye = tuple(away * way for way in (-19.0, -8.6, -6.6))
    return _eye(
        "world/chase",
        "Chase",
        ["/world/**", "- /world/aircraft/cockpit"],
        rrb.EyeControls3D(kind=rrb.Eye3DKind.Orbital, position=eye, look_target=(0.6, -0.2, -1.6), eye_up=(0, 0, -1)),
    )


def _cockpit() -> Any:
    ahead, right, down = cockpit.EYE
    target = (ahead + 1.0, right, down + cockpit.LOOKS_DOWN)
    hidden = ("world/aircraft/body", "world/trail", "world/rose", "world/wind")
    return _eye(
        "world/aircraft",
        "Cockpit",
        ["/world/**", *(f"- /{path}/**" for path in hidden)],
        rrb.EyeControls3D(kind=rrb.Eye3DKind.FirstPerson, position=cockpit.EYE, look_target=target, eye_up=(0, 0, -1)),
    )


def _eye(origin: str, name: str, contents: list[str], eye: Any) -> Any:
    """A view of the world from a frame that moves."""
    scenery = ("/world/horizon", "/world/ground", "/world/runway", "/world/rose")
    return rrb.Spatial3DView(
        origin=origin,
        contents=contents,
        name=name,
        background=rrb.Background(color=(206, 216, 222)),
        eye_controls=eye,
        line_grid=rrb.LineGrid3D(visible=False),
        spatial_information=rrb.SpatialInformation(target_frame=f"tf#/{origin}", show_axes=False),
        overrides={path: rrb.EntityBehavior(interactive=False) for path in scenery},
    )


def _flat(
    origin: str, name: str, bounds: tuple[tuple[float, float], tuple[float, float]], *, bare: bool = False
) -> Any:
    """A drawing; bare, it needs no title."""
    return rrb.Spatial2DView(
        origin=origin,
        name=name,
        titlebar=not bare,
        background=rrb.Background(color=BACKGROUND),
        visual_bounds=rrb.VisualBounds2D(x_range=bounds[0], y_range=bounds[1]),
    )


def _instruments() -> Any:
    return _flat("instruments", "Instruments", rerun_instruments.BOUNDS, bare=True)


def _corridor(*, bare: bool = False) -> Any:
    return _flat("corridor", "Conversion corridor", rerun_corridor.BOUNDS, bare=bare)


def _map() -> Any:
    return _flat("map", "Map", ground_map.BOUNDS)


def _events() -> Any:
    return rrb.TextLogView(
        origin="events/log",
        name="Events",
        columns=rrb.TextLogColumns(timeline_columns=["sim_time"], text_log_columns=["LogLevel", "Body"]),
    )


def _modes(*, follow: bool) -> Any:
    return rrb.StateTimelineView(
        origin="events",
        contents=["/events/mode", "/events/corridor", "/events/pilot", "/events/protection"],
        name="States",
        time_view=_time_axis(SHOWN_SECONDS) if follow else None,
    )


def _time_series(path: str, title: str, *, follow: bool, legend: bool = True, corner: Any = "LeftTop") -> Any:
    """A plot; while the flight goes on, of its last seconds."""
    window = None
    if follow:
        relative = rrb.TimeRangeBoundary.cursor_relative
        window = [rrb.VisibleTimeRange("sim_time", start=relative(seconds=-SHOWN_SECONDS), end=relative())]
    return rrb.TimeSeriesView(
        origin=path,
        name=title,
        axis_x=_time_axis(SHOWN_SECONDS) if follow else None,
        time_ranges=window,
        plot_legend=rrb.PlotLegend(corner=corner, visible=legend),
    )


def _time_axis(seconds: float) -> Any:
    relative = rrb.TimeRangeBoundary.cursor_relative
    return rrb.TimeAxis(view_range=rr.TimeRange(start=relative(seconds=-seconds), end=relative()))


def _group_of(path: str) -> str:
    return path.split("/")[1]
