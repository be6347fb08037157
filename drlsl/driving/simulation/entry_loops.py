"""The scenes of an ego that looks for an entry: a plain function, compiled where it is used."""

from __future__ import annotations

import math

from drlsl.lowering.backends import Floats1, Floats3, Integers1, Integers2, Mask2, Words1, Words2
from drlsl.traffic import LANE, LENGTH, UNIT, VEHICLE, WIDTH


def entry_scenes(
    frames: Integers1,
    motion: Words1,
    piece: Words1,
    table: Words2,
    x: Floats1,
    y: Floats1,
    place_lane: Integers1,
    limit: Floats1,
    sign: float,
    reach: float,
    ego: int,
    ego_length: float,
    ego_width: float,
    numbers: Floats3,
    vehicle: Integers2,
    lane: Integers2,
    valid: Mask2,
    speed: Floats1,
) -> None:
    """Write the scenes with the ego at every place in some frames of one film, and its `speed`; F x P rows.

    `motion`, `piece` and `table` are those of `Films`. `x`, `y`, `place_lane` and `limit`
    (P,) are the places'. The speed is the mean of those of the nearest leader and follower within `reach`, at
    most the limit; the limit if alone.
    """
    places, slots = len(x), valid.shape[1]
    for number in range(len(frames)):
        # The first row of a frame is read from the film, the others are copies of it.
        first = number * places
        for column in range(4):
            begin = (4 * frames[number] + column) * slots
            moves = motion[begin : begin + slots]
            for slot in range(slots):
                numbers[column, first, slot] = moves[slot] * UNIT
        pieces = piece[frames[number] * slots : (frames[number] + 1) * slots]
        for slot in range(slots):
            at = pieces[slot]
            vehicle[first, slot], lane[first, slot] = table[at, VEHICLE], table[at, LANE]
            numbers[4, first, slot], numbers[5, first, slot] = (
                table[at, LENGTH] * UNIT,
                table[at, WIDTH] * UNIT,
            )
        for place in range(places):
            row = first + place
            for column in range(6):
                for slot in range(slots):
                    numbers[column, row, slot] = numbers[column, first, slot]
            ahead, behind, leader, follower = math.inf, math.inf, 0.0, 0.0
            for slot in range(slots):
                there = vehicle[first, slot] >= 0 and slot > 0
                vehicle[row, slot], lane[row, slot] = vehicle[first, slot], lane[first, slot]
                dx, dy = numbers[0, row, slot] - x[place], numbers[1, row, slot] - y[place]
                valid[row, slot] = there and dx * dx + dy * dy <= reach * reach
                if there and lane[row, slot] == place_lane[place] and abs(dx) <= reach:
                    if 0.0 <= sign * dx < ahead:
                        ahead, leader = sign * dx, sign * numbers[2, row, slot]
                    elif 0.0 < -sign * dx < behind:
                        behind, follower = -sign * dx, sign * numbers[2, row, slot]
            found = (ahead < math.inf) + (behind < math.inf)
            mean = (leader + follower) / found if found > 0 else limit[place]
            speed[row] = min(max(mean, 0.0), limit[place])
            numbers[0, row, 0], numbers[1, row, 0] = x[place], y[place]
            numbers[2, row, 0], numbers[3, row, 0] = sign * speed[row], 0.0
            numbers[4, row, 0], numbers[5, row, 0] = ego_length, ego_width
            vehicle[row, 0], lane[row, 0], valid[row, 0] = ego, place_lane[place], True
