from pathlib import Path

import numpy as np
import pandas as pd
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.image import imread

from drlsl.learning import FIGURES, moving_average
from drlsl.learning.figures import write_training_figures


@given(values=st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=60), window=st.integers(1, 25))
def test_the_moving_average_is_a_mean_over_the_last(values: list[float], window: int) -> None:
    expected = [np.mean(values[max(0, stop - window) : stop]) for stop in range(1, len(values) + 1)]
    np.testing.assert_allclose(moving_average(np.array(values), window), expected, atol=1e-8)


def test_five_figures_of_several_runs(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    runs = {
        name: pd.DataFrame({column: rng.normal(size=30) for column, _ in FIGURES.values()})
        for name in ("dqn", "dqnsl")
    }
    paths = write_training_figures(runs, tmp_path / "figures")
    assert {path.stem for path in paths} == set(FIGURES)
    assert len(paths) == 5
    for path in paths:
        image = imread(path)
        assert image.shape[:2] == (400, 800)
        assert image.std() > 0.01
    one = write_training_figures({"dqn": runs["dqn"]}, tmp_path / "one")
    assert one[0].read_bytes() != paths[0].read_bytes()


def test_a_run_without_episodes_can_be_drawn(tmp_path: Path) -> None:
    empty = pd.DataFrame({column: [] for column, _ in FIGURES.values()}, dtype=np.float64)
    assert len(write_training_figures({"dqnsl": empty}, tmp_path)) == 5
