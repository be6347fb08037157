"""One step of N egos, as loops over egos: plain functions, compiled to machine code where they are used.

Arrays of shape (N,) are fields of `Places` and `Courses`, those of shape (N, L) of `Courses`, where they are
described. `places` (P,) are the egos that a function is about.
"""

from __future__ import annotations

import math
from typing import Final

from drlsl.driving.scene import CENTRE_TOLERANCE
from drlsl.driving.simulation.controllers import lane_control, move, move_forward, speed_control
from drlsl.driving.simulation.reward import reward_term
from drlsl.lowering.backends import (
    Floats1,
    Floats2,
    Floats3,
    Integers1,
    Integers2,
    Mask1,
    Mask2,
    Words1,
    Words2,
    prefetch,
)
from drlsl.traffic import CELL, LANE, LENGTH, PIECE, UNIT, VEHICLE, WIDTH

NO_ONE: Final = -1

EGO: Final = -1
"""The ego's number among the vehicles of a scene."""

LEFT: Final = 1
"""The number of the action that changes to the left; a greater one changes to the right."""

FETCHED: Final = 6
"""Egos whose rows of a film are fetched ahead of the one that is looked at."""

CONTACT, OFF_ROAD, TERMINATED, TRUNCATED, ENTERS, PLAYING = range(6)
"""The rows of the events of a step."""

REWARD, DISTANCE, SPEED, ACCELERATION, JERK, FIRST_TERM = range(6)
"""The rows of the numbers of a step; the terms of the reward begin at the last."""


def lane_place(lane_id: Integers2, ego: int, lane: int) -> int:
    """Return the place of a lane among those of an ego's direction; `NO_ONE` without one."""
    for place in range(lane_id.shape[1]):
        if lane_id[ego, place] == lane:
            return place
    return NO_ONE


def steer(
    actions: Integers1,
    lane_to_keep: Integers1,
    y: Floats1,
    ended: Mask1,
    target_lane: Integers1,
    target_y: Floats1,
    sign: Floats1,
    lanes: Integers1,
    lane_id: Integers2,
    centre: Floats2,
    width: Floats2,
    changed: Mask1,
) -> int:
    """Set the lanes to steer for, and mark who starts a lane change.

    Return an ego whose lane to keep is none of its direction; there nothing is set, nor for later egos.
    """
    for ego in range(len(actions)):
        changed[ego] = actions[ego] != 0 and not ended[ego] and settled(y[ego], target_y[ego])
        if changed[ego]:
            here = max(lane_place(lane_id, ego, target_lane[ego]), 0)
            there, aim = beside(ego, here, actions[ego] == LEFT, sign, lanes, centre, width)
            target_lane[ego], target_y[ego] = lane_id[ego, there], aim
        elif lane_to_keep[ego] != target_lane[ego] and not ended[ego]:
            kept = lane_place(lane_id, ego, lane_to_keep[ego])
            if kept == NO_ONE:
                return ego
            target_lane[ego], target_y[ego] = lane_to_keep[ego], centre[ego, kept]
    return NO_ONE


def settled(y: float, target_y: float) -> bool:
    """Return whether an ego is near enough to the centre of its lane to start a lane change."""
    return abs(target_y - y) <= CENTRE_TOLERANCE


def beside(
    ego: int, here: int, left: bool, sign: Floats1, lanes: Integers1, centre: Floats2, width: Floats2
) -> tuple[int, float]:
    """Return the place of the next lane to a side, and its centre [m].

    Without such a lane they are those of the same lane and where the next one's centre would be.
    """
    # y points downward: for an ego heading right, left is down the list of lanes.
    step = (-1 if left else 1) * int(sign[ego])
    there = min(max(here + step, 0), lanes[ego] - 1)
    if there == here:
        return there, centre[ego, here] + step * width[ego, here]
    return there, centre[ego, there]


def find_targets(
    places: Integers1,
    lane_to_keep: Integers1,
    y: Floats1,
    target_lane: Integers1,
    target_y: Floats1,
    sign: Floats1,
    lanes: Integers1,
    lane_id: Integers2,
    centre: Floats2,
    width: Floats2,
    found: Floats2,
) -> int:
    """Write the y [m] that each action would steer for, shape (P, 3), NaN if it would be ignored.

    `lane_to_keep` is of shape (P,). Return a place whose lane to keep is none of its direction, or `NO_ONE`.
    """
    for place in range(len(places)):
        ego = places[place]
        found[place, 0] = target_y[ego]
        if lane_to_keep[place] != target_lane[ego]:
            kept = lane_place(lane_id, ego, lane_to_keep[place])
            if kept == NO_ONE:
                return place
            found[place, 0] = centre[ego, kept]
        here = max(lane_place(lane_id, ego, target_lane[ego]), 0)
        for action in range(1, 3):
            _, aim = beside(ego, here, action == LEFT, sign, lanes, centre, width)
            found[place, action] = aim if settled(y[ego], target_y[ego]) else math.nan
    return NO_ONE


def drive(
    target_speed: Floats1,
    comfortable: Floats1,
    x: Floats1,
    y: Floats1,
    speed: Floats1,
    vy: Floats1,
    target_y: Floats1,
    frame: Integers1,
    distance: Floats1,
    speed_integral: Floats1,
    lane_integral: Floats1,
    acceleration: Floats1,
    sign: Floats1,
    dt: Floats1,
    tracks: Floats3,
    now: int,
    kept: Integers1,
) -> None:
    """Run the controllers, move the egos and the recording on by one frame, and write the row `now`."""
    for ego in range(len(x)):
        forward, speed_integral[ego], acceleration[ego] = speed_control(
            speed[ego],
            target_speed[ego],
            comfortable[ego],
            dt[ego],
            speed_integral[ego],
            acceleration[ego],
        )
        sideways, lane_integral[ego] = lane_control(
            y[ego], vy[ego], target_y[ego], dt[ego], lane_integral[ego]
        )
        along, speed[ego] = move_forward(speed[ego], forward, dt[ego])
        x[ego] = x[ego] + sign[ego] * along
        y[ego], vy[ego] = move(y[ego], vy[ego], sideways, dt[ego])
        frame[ego] += 1
        distance[ego] += along
        tracks[now, 0, ego], tracks[now, 1, ego], tracks[now, 2, ego] = x[ego], y[ego], speed[ego]
        kept[ego] += 1


def look(
    places: Integers1,
    cells: Words1,
    table: Words2,
    x: Floats1,
    y: Floats1,
    speed: Floats1,
    vy: Floats1,
    frame: Integers1,
    cells_begin: Integers1,
    first_piece: Integers1,
    frames: Integers1,
    own_slots: Integers1,
    sign: Floats1,
    lane_id: Integers2,
    centre: Floats2,
    lag: Floats2,
    lag_speed: Floats2,
    ego_length: float,
    ego_width: float,
    reach: float,
    numbers: Floats3,
    vehicle: Integers2,
    lane: Integers2,
    valid: Mask2,
    touching: Mask2,
) -> bool:
    """Write the scenes around egos, shape (P, S), and which vehicles touch them; return whether any does.

    `cells` and `table` are those of `Films`. `lag` and `lag_speed` (N, S) are those of traffic that reacts,
    or of no rows.
    """
    slots, any_touches = valid.shape[1], False
    for place in range(len(places)):
        if place + FETCHED < len(places):
            later = places[place + FETCHED]
            size = CELL * own_slots[later]
            begin = cells_begin[later] + min(frame[later], frames[later] - 1) * size
            prefetch(cells, begin, begin + size)
        ego = places[place]
        own = own_slots[ego]
        begin = cells_begin[ego] + min(frame[ego], frames[ego] - 1) * CELL * own
        for column in range(PIECE):
            # Parts of an array, since loops over whole ones with an offset are compiled to slower code.
            moves = cells[begin + column * own : begin + (column + 1) * own]
            for slot in range(own):
                numbers[column, place, slot] = moves[slot] * UNIT
            for slot in range(own, slots):
                numbers[column, place, slot] = 0.0
        pieces, first = cells[begin + PIECE * own : begin + CELL * own], first_piece[ego]
        for slot in range(slots):
            # Slots that a film does not have are empty, as its slot 0 is.
            at = first + (pieces[slot] if slot < own else 0)
            vehicle[place, slot], lane[place, slot] = table[at, VEHICLE], table[at, LANE]
            numbers[4, place, slot], numbers[5, place, slot] = (
                table[at, LENGTH] * UNIT,
                table[at, WIDTH] * UNIT,
            )
        if len(lag) > 0:
            for slot in range(slots):
                if lag[ego, slot] != 0.0:
                    numbers[0, place, slot] -= sign[ego] * lag[ego, slot]
                    numbers[2, place, slot] = sign[ego] * lag_speed[ego, slot]
        numbers[0, place, 0], numbers[1, place, 0] = x[ego], y[ego]
        numbers[2, place, 0], numbers[3, place, 0] = sign[ego] * speed[ego], vy[ego]
        numbers[4, place, 0], numbers[5, place, 0] = ego_length, ego_width
        nearest = 0
        for other in range(1, centre.shape[1]):
            if abs(centre[ego, other] - y[ego]) < abs(centre[ego, nearest] - y[ego]):
                nearest = other
        lane[place, 0] = lane_id[ego, nearest]
        touches = False
        for slot in range(slots):
            dx, dy = numbers[0, place, slot] - x[ego], numbers[1, place, slot] - y[ego]
            recorded = vehicle[place, slot] >= 0
            valid[place, slot] = (dx * dx + dy * dy <= reach * reach) & recorded
            meets = abs(dx) < (numbers[4, place, slot] + ego_length) / 2
            meets &= abs(dy) < (numbers[5, place, slot] + ego_width) / 2
            touching[place, slot] = meets & recorded
            touches |= meets & recorded
        valid[place, 0], vehicle[place, 0] = True, EGO
        any_touches |= touches
    return any_touches


def finish(
    touching: Mask2,
    changed: Mask1,
    front_is_free: Mask1,
    x: Floats1,
    y: Floats1,
    speed: Floats1,
    frame: Integers1,
    distance: Floats1,
    ended: Mask1,
    playback: Integers1,
    frames: Integers1,
    dt: Floats1,
    sign: Floats1,
    start: Floats1,
    length: Floats1,
    low: Floats1,
    high: Floats1,
    low_after: Floats1,
    high_after: Floats1,
    end: Floats1,
    limit: Floats1,
    track_length: Floats1,
    tracks: Floats3,
    now: int,
    kept: Integers1,
    ego_length: float,
    ego_width: float,
    weights: Floats1,
    terms: Integers1,
    events: Mask2,
    numbers: Floats2,
) -> bool:
    """Write what became of the egos in this frame: `events` (6, N) and `numbers` (5 and the terms, N).

    `track_length` [m]: of each playback. Where a lane has ended, the ego may only be in those that go on.
    Return whether there is a contact, or anybody is to enter anew.
    """
    eventful = False
    for ego in range(len(x)):
        playing = not ended[ego]
        over = frame[ego] >= frames[ego]
        contact = playing and not over and touches_any(touching, ego)
        off_road = playing and leaves(y[ego], ego_width, low[ego], high[ego])
        if sign[ego] * x[ego] + ego_length / 2 > end[ego]:
            off_road |= playing and leaves(y[ego], ego_width, low_after[ego], high_after[ego])
        terminated = contact or off_road
        metres = track_length[playback[ego]]
        truncated = playing and not terminated and distance[ego] >= metres
        ended[ego] = ended[ego] or terminated or truncated
        driven = sign[ego] * (x[ego] - start[ego]) + ego_length / 2
        enters = not ended[ego] and (over or driven >= length[ego])
        events[CONTACT, ego], events[OFF_ROAD, ego] = contact, off_road
        events[TERMINATED, ego], events[TRUNCATED, ego] = terminated, truncated
        events[ENTERS, ego], events[PLAYING, ego] = enters, playing
        eventful |= contact or enters
        numbers[DISTANCE, ego], numbers[SPEED, ego] = distance[ego], speed[ego]
        numbers[ACCELERATION, ego], numbers[JERK, ego] = motion(tracks, now, kept[ego], ego, dt[ego])
        reward(ego, changed, front_is_free, metres, limit, dt, weights, terms, events, numbers)
    return eventful


def leaves(y: float, width: float, low: float, high: float) -> bool:
    """Return whether an ego is not between two edges [m]."""
    return y - width / 2 < low or y + width / 2 > high


def reward(
    ego: int,
    changed: Mask1,
    front_is_free: Mask1,
    metres: float,
    limit: Floats1,
    dt: Floats1,
    weights: Floats1,
    terms: Integers1,
    events: Mask2,
    numbers: Floats2,
) -> None:
    """Write the terms of an ego's reward and their sum, from its events and its other numbers.

    `metres`: the length of its track.
    """
    total = 0.0
    for place in range(len(terms)):
        term = reward_term(
            terms[place],
            weights,
            events[PLAYING, ego],
            changed[ego],
            front_is_free[ego],
            events[CONTACT, ego],
            events[OFF_ROAD, ego],
            numbers[SPEED, ego],
            numbers[DISTANCE, ego] / metres,
            limit[ego],
            numbers[ACCELERATION, ego],
            numbers[JERK, ego],
            dt[ego],
        )
        numbers[FIRST_TERM + place, ego] = term
        total += term
    numbers[REWARD, ego] = total


def touches_any(touching: Mask2, ego: int) -> bool:
    """Return whether any vehicle touches an ego."""
    found = False
    for slot in range(touching.shape[1]):
        found |= touching[ego, slot]
    return found


def motion(tracks: Floats3, now: int, kept: int, ego: int, dt: float) -> tuple[float, float]:
    """Return acceleration [m/s²] and jerk [m/s³] along the road; 0 where not yet known."""
    rows = tracks.shape[0]
    before, earlier = tracks[(now - 1) % rows, 2, ego], tracks[(now - 2) % rows, 2, ego]
    change = (tracks[now, 2, ego] - before) / dt if kept >= 2 else 0.0
    jerk = (change - (before - earlier) / dt) / dt if kept >= 3 else 0.0
    return change, jerk
