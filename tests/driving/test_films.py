"""Films of several recordings lie where they are, and every ego reads its own."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from drlsl.driving.simulation.films import Films, spanned
from drlsl.traffic import LANE, LENGTH, UNIT, VEHICLE, Film, load_recording
from tests.driving.recordings import Drive, recording


@pytest.fixture(scope="module")
def three() -> list[Film]:
    """Two films that are mapped from files and one in memory, with 53, 1 and 26 slots for vehicles."""
    by_hand = recording([Drive(3, 10.0, 20.0), Drive(4, 30.0, 10.0, begin=330)], frames=360)
    return [load_recording("highway-test").film, by_hand.film, load_recording("merge-test").film]


def test_arrays_are_found_in_one_that_spans_them() -> None:
    arrays = [np.arange(low, low + size, dtype=np.int32) for low, size in ((0, 5000), (7, 3), (99, 70_000))]
    whole, begins = spanned(arrays)
    for array, begin in zip(arrays, begins.tolist(), strict=True):
        assert np.array_equal(whole[begin : begin + len(array)], array)
        assert np.shares_memory(whole[begin : begin + len(array)], array)
    assert not whole.flags.writeable


def test_an_array_between_words_is_refused() -> None:
    odd = np.zeros(9, dtype=np.uint8)[1:].view(np.int32)
    with pytest.raises(ValueError, match="begin at a word"):
        spanned([np.zeros(2, dtype=np.int32), odd])


@pytest.mark.parametrize("copied", [False, True])
def test_every_ego_reads_its_own_film(three: list[Film], copied: bool) -> None:
    films = Films(three)
    if copied:
        films = pickle.loads(pickle.dumps(films))  # noqa: S301  (made here)
    rng, reels = np.random.default_rng(1), films.reels
    for _ in range(50):
        frame = rng.integers(0, 4000, 3)
        pieces, valid = films.pieces(reels, frame), films.valid(reels, frame)
        for ego, film in enumerate(three):
            row = np.array([min(int(frame[ego]), len(film) - 1)])
            own, slots = pieces[ego], film.slots
            assert np.array_equal(valid[ego, :slots], film.valid(row)[0])
            assert not valid[ego, slots:].any()
            assert np.array_equal(films.table[own, VEHICLE][:slots], film.vehicle(row)[0])
            assert (films.table[own, VEHICLE][slots:] == -1).all()
            assert np.array_equal(films.table[own, LANE][:slots], film.lane(row)[0])
            assert np.array_equal(films.table[own][:slots, LENGTH:].T * UNIT, film.numbers(row)[4:, 0])
        slot = np.array([rng.integers(film.slots) for film in three])
        for column in range(4):
            here = films.motion_of(reels, column, frame, slot)
            rows = [min(int(at), len(film) - 1) for at, film in zip(frame, three, strict=True)]
            expected = [
                film.numbers(np.array([row]))[column, 0, place]
                for film, row, place in zip(three, rows, slot, strict=True)
            ]
            assert here.tolist() == expected
        assert np.array_equal(films.piece_of(reels, frame, slot), pieces[np.arange(3), slot])
