"""Functions that make networks: found by name, named again, and refused in one line."""

import subprocess
import sys
from pathlib import Path

import pytest
from torch import nn

from drlsl.cli import run
from drlsl.errors import UserError
from drlsl.learning import RunFolder, architectures, train
from drlsl.learning.config import NetworkConfig
from drlsl.learning.network_factory import call_factory, factory_name, find_factory

from . import networks

NETWORKS = f"{networks.__name__}:"
FILE = Path(networks.__file__)


@pytest.fixture(autouse=True)
def _in_a_folder_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fake_driving: None) -> None:
    monkeypatch.chdir(tmp_path)


def refused(capsys: pytest.CaptureFixture[str], factory: str, *more: str) -> str:
    """The one line that a training with a network is refused in; it leaves nothing behind."""
    assert run(["train", "--preset", "tiny", "--network", factory, "--out", "run", *more]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1
    assert not Path("run").exists()
    return captured.err


@pytest.mark.parametrize(
    ("factory", "part"),
    [
        ("double", "parameter weight is torch.float64, expected torch.float32"),
        ("narrow", "expected values of torch.float32 and shape (1, 3), got torch.float32 of shape (1, 4)"),
        ("squeezed", "expected values of torch.float32 and shape (1, 3), got torch.float32 of shape (3,)"),
        ("Listed", "its values depend on none of its parameters (are all layers attributes?)"),
        ("Pair", "shape (1, 3), got a tuple"),
        (
            "other_input",
            "its forward pass fails on observations of shape (1, 10): RuntimeError: mat1 and mat2",
        ),
        ("not_a_number", "gives values that are not finite, such as [nan, nan, nan]"),
        ("no_parameters", "the module has no parameters that learn"),
        ("all_frozen", "the module has no parameters that learn"),
        ("Detached", "its values depend on no parameter that learns"),
        ("Locked", "cannot be copied, as the target network must be: TypeError: cannot pickle"),
        ("Extra", "state_dict() holds a dict as _extra_state, expected tensors"),
        ("leaving", "cannot make the network: SystemExit: 3 (networks.py:"),
        ("raising", "cannot make the network: RuntimeError: first line (networks.py:"),
        ("no_module", "expected a torch.nn.Module, got a builtin_function_or_method"),
        ("missing", f"{networks.__name__} has no 'missing'"),
        ("NOT_CALLABLE", "expected a function or a class, found a int"),
        (
            "Recurrent",
            "its forward pass fails on observations of shape (1, 10): AssertionError (networks.py:",
        ),
    ],
)
def test_what_is_no_q_network_is_refused(factory: str, part: str, capsys: pytest.CaptureFixture[str]) -> None:
    found = refused(capsys, NETWORKS + factory)
    assert part in found
    assert f"network.factory {NETWORKS}{factory}: " in found


@pytest.mark.parametrize(
    ("factory", "more", "part"),
    [
        ("nets.py:make", [], f"no file nets.py in {'{here}'}"),
        ("no.such.module:make", [], "cannot import the module: ModuleNotFoundError: No module named 'no'"),
        (
            "duelling",
            [],
            "network.factory: expected mlp, dueling, FILE.py:FUNCTION or PACKAGE.MODULE:FUNCTION",
        ),
        ("nets.py", [], "network.factory: expected mlp"),
        ("os:kill", [], "expected a function or a class, found a builtin_function_or_method"),
        (NETWORKS + "wide", ["network.arguments.size=3"], "unexpected keyword argument 'size'"),
        (NETWORKS + "wide", ["network.arguments.actions=3"], "multiple values for argument 'actions'"),
        (NETWORKS + "wide", ["network.arguments.width=.nan"], "network.arguments: input should be a finite"),
        (
            NETWORKS + "wide",
            ["network.noisy=true"],
            "network.noisy is set, but the module has no method reset_noise",
        ),
        ("dueling", ["network.arguments.width=3"], "arguments are for a function of your own"),
        (
            "dueling",
            ["network.window=0"],
            "network.window: input should be greater than or equal to 1, got 0",
        ),
    ],
)
def test_what_is_not_found_or_does_not_fit_is_refused(
    factory: str, more: list[str], part: str, capsys: pytest.CaptureFixture[str]
) -> None:
    found = refused(capsys, factory, *(text for one in more for text in ("--set", one)))
    assert part.replace("{here}", str(Path.cwd())) in found


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("def make(:\n", "cannot run the file: SyntaxError: invalid syntax (nets.py, line 1)"),
        ("import sys\nsys.exit('bye')\n", "cannot run the file: SystemExit: bye (nets.py:2)"),
        ("x = 1\n\nprint(1 / 0)\n", "cannot run the file: ZeroDivisionError: division by zero (nets.py:3)"),
        (
            "from drlsl.learning import train\ntrain('again')\n",
            "its file starts a training when it is imported",
        ),
        (
            "def make(a, b):\n    from drlsl.learning import nothing\n",
            "ImportError: cannot import name 'nothing'",
        ),
    ],
)
def test_a_file_that_cannot_be_run_is_refused(
    text: str, part: str, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("nets.py").write_text(text)
    assert part in refused(capsys, "nets.py:make")
    assert not Path("again").exists()


def test_a_module_that_fails_in_training_ends_it_in_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["train", "--preset", "tiny", "--network", NETWORKS + "Late", "--out", "run"]) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    assert "its forward pass fails: ValueError: too many (networks.py:" in err


def test_the_same_command_trains_judges_and_resumes_a_network_in_a_file(
    capsys: pytest.CaptureFixture[str],
) -> None:
    Path("layers.py").write_text("WIDTH = 7\n")
    Path("nets.py").write_text(
        "from torch import nn\nfrom layers import WIDTH\n"
        "def make(size, actions, *, deep=1):\n"
        "    return nn.Sequential(*[nn.Linear(size, size) for _ in range(deep)], nn.Linear(size, actions))\n"
    )
    options = ["--network", "nets.py:make", "--set", "network.arguments.deep=2"]
    assert run(["train", "--preset", "tiny", *options, "--out", "run"]) == 0
    assert run(["eval", "run", "--episodes", "1", "--json"]) == 0
    assert run(["train", "--resume", "--out", "run"]) == 0
    config = RunFolder.open(Path("run")).config
    assert config.network.factory == "nets.py:make"
    assert config.network.arguments == {"deep": 2}
    capsys.readouterr()
    Path("nets.py").rename("other.py")
    assert run(["eval", "run"]) == 2
    assert "network.factory nets.py:make: no file nets.py in " in capsys.readouterr().err


def test_a_script_may_hand_in_functions_and_classes() -> None:
    folder = train("one", network=networks.wide, preset="tiny", episodes=2)
    assert folder.config.network.factory == NETWORKS + "wide"
    assert len(folder.metrics()) == 2
    given = {"factory": networks.Recurrent, "window": 2}
    assert train("two", network=given, preset="tiny", episodes=1).config.network.window == 2
    assert train("three", network="dueling", preset="tiny", episodes=1).config.network.factory == "dueling"
    assert train("four", preset="tiny", episodes=1).config.network.factory == "mlp"
    with pytest.raises(UserError, match="the folder exists"):
        train("four", preset="tiny")
    with pytest.raises(UserError, match=r"train\(\): unknown key 'episode'; did you mean 'episodes'"):
        train("five", episode=1)


def test_what_no_other_process_could_find_has_no_name() -> None:
    def inner(observation_size: int, actions: int) -> nn.Module:
        return nn.Linear(observation_size, actions)

    for factory in (inner, lambda size, actions: nn.Linear(size, actions), nn.Linear(2, 3)):
        with pytest.raises(UserError, match="expected a function at the top level of a file"):
            train("run", network=factory)
    assert not Path("run").exists()


def test_a_name_leads_back() -> None:
    assert find_factory(factory_name(architectures.dueling)) is architectures.dueling
    assert find_factory(factory_name(networks.Recurrent)) is networks.Recurrent
    config = NetworkConfig(factory=f"{FILE}:wide", arguments={"width": 5})
    made = call_factory(config, 4, 3)
    assert made[0].weight.shape == (5, 4)
    assert str(FILE.parent) not in sys.path


SCRIPT = """
from torch import nn
from drlsl import driving
from drlsl.learning import train
from drlsl.learning.session import load_policy
from drlsl.learning.rundir import RunFolder
from tests.learning.fake import fakes

vars(driving)["make_vec"] = lambda config, num_envs, mode, **_: fakes(num_envs, config.track_length or 840.0)

def mine(size, actions):
    return nn.Linear(size, actions)

{guard}train("run", network=mine, preset="tiny", episodes=1)
"""


def test_a_script_hands_in_what_it_defines(capsys: pytest.CaptureFixture[str]) -> None:
    Path("scripts").mkdir()
    script = Path("scripts/mine.py")
    script.write_text(SCRIPT.format(guard="if __name__ == '__main__': "))
    root = str(FILE.parents[2])
    subprocess.run([sys.executable, "scripts/mine.py"], check=True, env={"PYTHONPATH": root})
    assert RunFolder.open(Path("run")).config.network.factory == "scripts/mine.py:mine"
    assert run(["eval", "run", "--episodes", "1"]) == 0
    script.write_text(SCRIPT.format(guard=""))
    assert run(["eval", "run", "--episodes", "1"]) == 2
    assert "put that below `if __name__ == '__main__':`" in capsys.readouterr().err
