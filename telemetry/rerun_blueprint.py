"""How the views are laid out when the viewer opens: for the pilot, for the engineer, for replay."""

from __future__ import annotations

from typing import Any

import rerun as rr
import rerun.blueprint as rrb

from telemetry import rerun_corridor, rerun_instruments
from telemetry.log_format import LOG_SIGNALS
from telemetry.rerun_colours import BACKGROUND
from telemetry.signal_groups import plot_groups, plot_path
from telemetry.view_options import Layout

SHOWN_SECONDS = 30.0
"""Length of the time histories that follow the flight [s]."""


def blueprint(layout: Layout) -> Any:
    """The layout of that name.

    Args:
        layout: ``pilot``, ``engineer`` or ``replay``.
    """
    replay = layout == "replay"
    content = _engineer(follow=True) if layout == "engineer" else _pilot(follow=not replay)
    if replay:
        time_panel = rrb.TimePanel(state="expanded", timeline="sim_time", play_state="Paused")
    else:
        time_panel = rrb.TimePanel(state="collapsed", timeline="sim_time", play_state="Following")
    return rrb.Blueprint(
        content,
        time_panel,
        rrb.SelectionPanel(state="hidden"),
        rrb.BlueprintPanel(state="hidden"),
        rrb.TopPanel(state="hidden"),
        auto_views=False,
        auto_layout=False,
    )


def _pilot(*, follow: bool) -> Any:
    """Aircraft, instruments and corridor large; four plots and the events below."""
    plots = [
        _plot("Airspeed [kn]", "airspeed_kt", "airspeed_reference_kt", follow=follow),
        _plot("Nacelle [deg]", "nacelle_deg", "nacelle_reference_deg", follow=follow),
        _plot("Stick and lever", "stick", "lever", follow=follow),
        _plot("Flapping [deg]", "flapping_deg", "longitudinal_flapping_deg", follow=follow),
    ]
    top = rrb.Horizontal(_flight(), _instruments(), _corridor(), column_shares=[4.6, 4.35, 4.35])
    bottom = rrb.Horizontal(
        rrb.Grid(*plots, grid_columns=4), rrb.Vertical(_modes(follow=follow), _events(), row_shares=[5.2, 4.0]),
        column_shares=[8.95, 4.35],
    )  # fmt: skip
    return rrb.Vertical(top, bottom, row_shares=[2.0, 1.0])


def _engineer(*, follow: bool) -> Any:
    """Plots of every signal in three tabs beside corridor and aircraft."""
    groups = plot_groups()
    loop = {"loop"}
    motion = {"speed", "nacelle", "altitude", "attitude", "position"}

    def grid(name: str, names: set[str] | None) -> Any:
        chosen = [group for group in groups if _group_of(group.path) in (names or set())]
        if names is None:
            chosen = [group for group in groups if _group_of(group.path) not in loop | motion]
        views = [_time_series(group.path, group.title, follow=follow) for group in chosen]
        return rrb.Grid(*views, grid_columns=3, name=name)

    left = rrb.Vertical(_corridor(), _flight(), _events(), row_shares=[4.0, 3.0, 2.0])
    tabs = rrb.Tabs(
        grid("Aircraft, loads and controls", None), grid("Motion", motion), grid("Loop health", loop), active_tab=0
    )
    return rrb.Horizontal(
        left, rrb.Vertical(tabs, _modes(follow=follow), row_shares=[6.0, 1.3]), column_shares=[1.0, 2.2]
    )


def _flight() -> Any:
    return rrb.Spatial3DView(
        origin="world/chase",
        contents=["/world/**"],
        name="Flight",
        background=rrb.Background(color=(66, 92, 124)),
        eye_controls=rrb.EyeControls3D(
            kind=rrb.Eye3DKind.Orbital, position=(-16.0, -12.5, -9.2), look_target=(0.2, -0.9, -0.5), eye_up=(0, 0, -1)
        ),
        line_grid=rrb.LineGrid3D(visible=False),
        spatial_information=rrb.SpatialInformation(target_frame="tf#/world/chase", show_axes=False),
    )


def _flat(origin: str, name: str, bounds: tuple[tuple[float, float], tuple[float, float]]) -> Any:
    return rrb.Spatial2DView(
        origin=origin,
        name=name,
        background=rrb.Background(color=BACKGROUND),
        visual_bounds=rrb.VisualBounds2D(x_range=bounds[0], y_range=bounds[1]),
    )


def _instruments() -> Any:
    return _flat("instruments", "Instruments", rerun_instruments.BOUNDS)


def _corridor() -> Any:
    return _flat("corridor", "Conversion corridor", rerun_corridor.BOUNDS)


def _events() -> Any:
    return rrb.TextLogView(
        origin="events/log",
        name="Events",
        columns=rrb.TextLogColumns(timeline_columns=["sim_time"], text_log_columns=["LogLevel", "Body"]),
    )


def _modes(*, follow: bool) -> Any:
    return rrb.StateTimelineView(
        origin="events",
        contents=["/events/mode", "/events/corridor", "/events/pilot"],
        name="Mode, corridor, pilot",
        time_view=_time_axis(60.0) if follow else None,
    )


def _plot(title: str, *signal_names: str, follow: bool) -> Any:
    """Only the named signals of a group."""
    return _time_series(plot_path(signal_names[0]), title, follow=follow, shown=signal_names)


def _time_series(path: str, title: str, *, follow: bool, shown: tuple[str, ...] | None = None) -> Any:
    """A plot; while the flight goes on, of its last seconds."""
    window = None
    if follow:
        relative = rrb.TimeRangeBoundary.cursor_relative
        window = [rrb.VisibleTimeRange("sim_time", start=relative(seconds=-SHOWN_SECONDS), end=relative())]
    overrides: dict[Any, Any] | None = None
    if shown is not None:
        group = next(group for group in plot_groups() if group.path == path)
        visible = [LOG_SIGNALS[column].name in shown for column in group.columns]
        overrides = {path: [rr.SeriesLines(visible_series=visible)]}
    return rrb.TimeSeriesView(
        origin=path,
        name=title,
        overrides=overrides,
        axis_x=_time_axis(SHOWN_SECONDS) if follow else None,
        time_ranges=window,
        plot_legend=rrb.PlotLegend(corner="LeftTop"),
    )


def _time_axis(seconds: float) -> Any:
    relative = rrb.TimeRangeBoundary.cursor_relative
    return rrb.TimeAxis(view_range=rr.TimeRange(start=relative(seconds=-seconds), end=relative()))


def _group_of(path: str) -> str:
    return path.split("/")[1]
