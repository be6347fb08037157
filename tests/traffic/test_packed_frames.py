"""A film keeps every row to 0.05 mm, and constants of a vehicle once."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drlsl.errors import UserError
from drlsl.traffic import NUMBERS, UNIT, Film, Tracks, pack
from drlsl.traffic.packed_frames import LARGEST, VEHICLE
from drlsl.traffic.tracks import rounded

ROUNDING = UNIT / 2 * (1 + 1e-9)


@st.composite
def rows(draw: st.DrawFn) -> tuple[Tracks, np.ndarray]:
    """Sorted rows of up to four vehicles, whose sizes and lanes may change at any time, and their lanes."""
    present = sorted(draw(st.sets(st.tuples(st.integers(0, 3), st.integers(0, 9)), min_size=1)))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    vehicle, frame = np.array(present).T
    count, far = len(present), draw(st.sampled_from([10.0, 1000.0, 200_000.0]))
    x, y, vx, vy = rng.uniform(-far, far, (4, count))
    length, width = rng.choice([4.0, 4.56789, 12.3], (2, count))
    return Tracks(x, y, vx, vy, length, width, frame, vehicle), rng.integers(0, 3, count).astype(np.int16)


@given(rows())
def test_every_row_is_kept_to_a_twentieth_of_a_millimetre(given: tuple[Tracks, np.ndarray]) -> None:
    tracks, lane = given
    film = pack(tracks, lane, name="test")
    frames = film.frames
    for row in range(len(tracks)):
        one = film.frame(int(tracks.frame[row]))
        (place,) = np.flatnonzero(one.vehicle == tracks.vehicle[row])
        (slot,) = np.flatnonzero(frames.vehicle[tracks.frame[row]] == tracks.vehicle[row])
        assert one.lane[place] == frames.lane[tracks.frame[row], slot] == lane[row]
        for name in NUMBERS:
            kept = getattr(one, name)[place]
            assert abs(kept - getattr(tracks, name)[row]) <= ROUNDING + 1e-11
            assert kept == getattr(frames, name)[tracks.frame[row], slot]
            assert kept == getattr(rounded(tracks), name)[row]


@given(rows())
def test_a_film_of_its_own_numbers_is_the_same(given: tuple[Tracks, np.ndarray]) -> None:
    tracks, lane = given
    film, again = pack(tracks, lane, name="test"), pack(rounded(tracks), lane, name="test")
    for name in ("cells", "pieces"):
        assert np.array_equal(getattr(film, name), getattr(again, name))


@given(rows())
def test_parts_of_a_film_are_as_the_whole(given: tuple[Tracks, np.ndarray]) -> None:
    film = pack(*given, name="test")
    frames, valid = film.frames, film.frames.valid
    for chosen in (slice(None), np.array([len(film) - 1, 0])):
        there = valid[chosen]
        for name, column in zip(NUMBERS, film.numbers(chosen)[:, :, 1:], strict=True):
            assert np.array_equal(column[there], getattr(frames, name)[chosen][there])
            assert not column[~there].any()
        assert np.array_equal(film.valid(chosen)[:, 1:], there)
        assert np.array_equal(film.vehicle(chosen)[:, 1:], frames.vehicle[chosen])
        assert np.array_equal(film.lane(chosen)[:, 1:], frames.lane[chosen])
        assert not film.valid(chosen)[:, 0].any()


@given(rows(), st.integers(0, 2**32 - 1))
def test_vehicles_can_be_put_into_another_lane(given: tuple[Tracks, np.ndarray], seed: int) -> None:
    film = pack(*given, name="test")
    chosen = film.valid(slice(None)) & (np.random.default_rng(seed).random(film.piece.shape) < 0.5)
    before, other = film.cells.copy(), film.with_lane(chosen, 9)
    assert np.array_equal(film.cells, before)
    assert np.array_equal(other.lane(slice(None)), np.where(chosen, 9, film.lane(slice(None))))
    for one, same in ((film.vehicle, other.vehicle), (film.numbers, other.numbers)):
        assert np.array_equal(one(slice(None)), same(slice(None)))


def steady(count: int) -> Tracks:
    ones, frame = np.ones(count), np.arange(count)
    x = np.linspace(0.0, 1000.0, count)
    return Tracks(x, ones, 30.0 * ones, 0.0 * ones, 4.5 * ones, 1.8 * ones, frame, np.full(count, 7))


def test_what_is_constant_is_kept_once() -> None:
    film = pack(steady(500), np.repeat([1, 2], 250).astype(np.int16), name="test")
    assert film.pieces[:, VEHICLE].tolist() == [-1, 7, 7], "nobody, and one vehicle in two lanes"
    assert film.cells.nbytes == 500 * 2 * 20


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1.01 * LARGEST])
@pytest.mark.parametrize("name", NUMBERS)
def test_a_number_that_a_film_cannot_hold_is_refused(name: str, value: float) -> None:
    tracks = steady(3)
    values = getattr(tracks, name).copy()
    values[1] = value
    with pytest.raises(UserError, match=f"test: `{name}` is (not finite|up to)"):
        pack(replace(tracks, **{name: values}), np.ones(3, dtype=np.int16), name="test")


def test_a_film_cannot_be_written() -> None:
    film = pack(steady(3), np.ones(3, dtype=np.int16), name="test")
    for name in ("cells", "motion", "piece", "pieces"):
        with pytest.raises(ValueError, match="read-only"):
            getattr(film, name)[...] = 1
    assert isinstance(film, Film)
