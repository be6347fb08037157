"""The scenes of an ego that looks for an entry: a plain function, compiled where it is used."""

from __future__ import annotations

import math

from drlsl.lowering.backends import Floats1, Floats3, Integers1, Integers2, Mask2, Words1, Words2
from drlsl.traffic import CELL, LANE, LENGTH, PIECE, UNIT, VEHICLE, WIDTH


def slots_between(frames: Integers1, cells: Words1, low: float, high: float, found: Integers2) -> int:
    """Write the slots of the vehicles with an x from `low` to `high` [m] in some frames of one film.

    `cells` are those of `Films`. `found` is of shape (F, S): in a frame column 0 is for the ego,
    then come the slots in their order, then slot 0, which is empty. Return how many columns all of them take.
    """
    slots, most = found.shape[1], 1
    for number in range(len(frames)):
        begin = CELL * frames[number] * slots
        places = cells[begin : begin + slots]
        pieces = cells[begin + PIECE * slots : begin + CELL * slots]
        column = 1
        for slot in range(1, slots):
            if pieces[slot] > 0 and low <= places[slot] * UNIT <= high:
                found[number, column] = slot
                column += 1
        most = max(most, column)
        for empty in range(column, slots):
            found[number, empty] = 0
    return most


def entry_scenes(
    frames: Integers1,
    cells: Words1,
    table: Words2,
    found: Integers2,
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

    `cells` and `table` are those of `Films`, `found` is that of `slots_between`, of which there are
    as many columns as the scenes have. `x`, `y`, `place_lane` and `limit`
    (P,) are the places'. The speed is the mean of those of the nearest leader and follower within `reach`, at
    most the limit; the limit if alone.
    """
    places, columns, slots = len(x), valid.shape[1], found.shape[1]
    for number in range(len(frames)):
        # The first row of a frame is read from the film, the others are copies of it.
        first, begin = number * places, CELL * frames[number] * slots
        pieces = cells[begin + PIECE * slots : begin + CELL * slots]
        for row in range(PIECE):
            moves = cells[begin + row * slots : begin + (row + 1) * slots]
            for column in range(1, columns):
                numbers[row, first, column] = moves[found[number, column]] * UNIT
        for column in range(1, columns):
            at = pieces[found[number, column]]
            vehicle[first, column], lane[first, column] = table[at, VEHICLE], table[at, LANE]
            numbers[4, first, column], numbers[5, first, column] = (
                table[at, LENGTH] * UNIT,
                table[at, WIDTH] * UNIT,
            )
        for place in range(places):
            here = first + place
            for row in range(6):
                for column in range(1, columns):
                    numbers[row, here, column] = numbers[row, first, column]
            ahead, behind, leader, follower = math.inf, math.inf, 0.0, 0.0
            for column in range(1, columns):
                there = vehicle[first, column] >= 0
                vehicle[here, column], lane[here, column] = vehicle[first, column], lane[first, column]
                dx, dy = numbers[0, here, column] - x[place], numbers[1, here, column] - y[place]
                valid[here, column] = there and dx * dx + dy * dy <= reach * reach
                if there and lane[here, column] == place_lane[place] and abs(dx) <= reach:
                    if 0.0 <= sign * dx < ahead:
                        ahead, leader = sign * dx, sign * numbers[2, here, column]
                    elif 0.0 < -sign * dx < behind:
                        behind, follower = -sign * dx, sign * numbers[2, here, column]
            neighbours = int(ahead < math.inf) + int(behind < math.inf)
            mean = (leader + follower) / neighbours if neighbours > 0 else limit[place]
            speed[here] = min(max(mean, 0.0), limit[place])
            numbers[0, here, 0], numbers[1, here, 0] = x[place], y[place]
            numbers[2, here, 0], numbers[3, here, 0] = sign * speed[here], 0.0
            numbers[4, here, 0], numbers[5, here, 0] = ego_length, ego_width
            vehicle[here, 0], lane[here, 0], valid[here, 0] = ego, place_lane[place], True
