"""Totals over the episodes of an evaluation, and the time that they save against others."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from drlsl.driving.simulation import headway_quantile
from drlsl.learning.episode import EpisodeSummary


@dataclass(frozen=True, slots=True)
class Totals:
    """Totals over the episodes of one evaluation.

    Source: Table 1 (lane changes, collisions, off-road, time steps).
    """

    episodes: int
    lane_changes: int
    contacts_at_fault: int
    contacts_not_at_fault: int
    off_road: int
    completed: int
    """Episodes that reached the end of the track."""
    mean_steps: float
    mean_steps_completed: float | None
    """Mean over the completed episodes only, because a contact shortens an episode, too; None without any."""
    mean_speed: float
    """Mean over all steps, m/s."""
    mean_return: float
    interventions: float
    """Share of steps in which the action of highest value was not one the rules derive to be safe."""
    not_offered: int
    """Steps in which an action was asked for that was not offered: 0 with the shield on."""
    fail_safe: int
    """Steps in which the shield fell back to its fail-safe."""
    at_fault_per_1000_km: float | None
    excused_per_1000_km: float | None
    """Contacts that are not the ego's fault; None, as all rates, if nothing was driven."""
    lane_changes_per_km: float | None
    interventions_per_km: float | None
    windows_per_km: float | None = None
    """How often a lane change began to be offered."""
    mean_time_completed: float | None = None
    """Mean over the completed episodes, s."""
    jerk_rms: float | None = None
    """Root of the mean square of the jerk along the road, m/s³."""
    hard_braking: float | None = None
    """Share of the time in which the ego brakes harder than 3 m/s²."""
    short_ttc: float | None = None
    """Share of the time with a time to collision below 4 s to the leader."""
    headway_5: float | None = None
    """Time headway to the leader below which the ego is for 5 % of the time, s."""
    headway_50: float | None = None
    imposed_braking: float | None = None
    """Mean over the episodes of the hardest braking of the follower in the ego's lane, m/s²."""
    imposed_hard_braking: float | None = None
    """Share of the time in which that follower brakes harder than 3 m/s²."""


def totals(summaries: Sequence[EpisodeSummary]) -> Totals:
    """Add up episodes.

    Raises:
        ValueError: there are none.
    """
    if not summaries:
        raise ValueError("no episodes to add up")
    steps = sum(item.steps for item in summaries)
    completed = [item.steps for item in summaries if item.completed]
    kilometres = sum(item.distance for item in summaries) / 1000
    changes = sum(item.lane_changes for item in summaries)
    interventions = sum(item.interventions for item in summaries)
    at_fault = sum(item.contact and item.at_fault for item in summaries)
    excused = sum(item.contact and not item.at_fault for item in summaries)
    return Totals(
        episodes=len(summaries),
        lane_changes=changes,
        contacts_at_fault=at_fault,
        contacts_not_at_fault=excused,
        off_road=sum(item.off_road for item in summaries),
        completed=len(completed),
        mean_steps=steps / len(summaries),
        mean_steps_completed=float(np.mean(completed)) if completed else None,
        mean_speed=sum(item.mean_speed * item.steps for item in summaries) / steps,
        mean_return=float(np.mean([item.total_return for item in summaries])),
        interventions=interventions / steps,
        not_offered=sum(item.not_offered for item in summaries),
        fail_safe=sum(item.fail_safe for item in summaries),
        at_fault_per_1000_km=_rate(at_fault, kilometres / 1000),
        excused_per_1000_km=_rate(excused, kilometres / 1000),
        lane_changes_per_km=_rate(changes, kilometres),
        interventions_per_km=_rate(interventions, kilometres),
        **_measured(summaries, kilometres),
    )


def _rate(count: float, way: float) -> float | None:
    return count / way if way else None


def _measured(summaries: Sequence[EpisodeSummary], kilometres: float) -> dict[str, Any]:
    """Return the totals of measures; none if an episode has none."""
    measures = [item.measures for item in summaries if item.measures is not None]
    if len(measures) < len(summaries):
        return {}
    time = sum(one.time for one in measures)
    headways = np.sum([one.headways for one in measures], axis=0)
    completed = [one.time for one, item in zip(measures, summaries, strict=True) if item.completed]
    return {
        "windows_per_km": _rate(sum(one.windows for one in measures), kilometres),
        "mean_time_completed": float(np.mean(completed)) if completed else None,
        "jerk_rms": float(np.sqrt(sum(one.jerk_square for one in measures) / time)),
        "hard_braking": sum(one.hard_braking for one in measures) / time,
        "short_ttc": sum(one.short_ttc for one in measures) / time,
        "headway_5": headway_quantile(headways, 0.05),
        "headway_50": headway_quantile(headways, 0.5),
        "imposed_braking": float(np.mean([one.imposed for one in measures])),
        "imposed_hard_braking": sum(one.imposed_hard for one in measures) / time,
    }


def times_of(summaries: Sequence[EpisodeSummary]) -> list[float | None]:
    """Return the duration of each episode [s]; None for one that was not completed, or not measured."""
    return [
        item.measures.time if item.measures is not None and item.completed else None for item in summaries
    ]


def time_saved(times: Sequence[float | None], others: Sequence[float | None]) -> float | None:
    """Return the share of the others' time that is saved over the episodes that both completed.

    Both are durations [s] of the same episodes, None for one that was not completed. None without an episode
    that both completed.

    Raises:
        ValueError: the episodes differ in number.
    """
    pairs = zip(times, others, strict=True)
    both = [(mine, other) for mine, other in pairs if mine is not None and other is not None]
    if not both:
        return None
    return 1.0 - sum(mine for mine, _ in both) / sum(other for _, other in both)
