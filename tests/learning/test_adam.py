import ast
import math
import re
from pathlib import Path

import torch

import drlsl
from drlsl.learning.adam import Adam, no_subnormals


def test_it_is_pytorchs_adam_to_the_bit() -> None:
    generator = torch.Generator().manual_seed(0)
    mine = torch.randn(500, generator=generator)
    theirs = torch.nn.Parameter(mine.clone())
    mine_gradient = torch.zeros(500)
    adam, reference = Adam(mine, mine_gradient), torch.optim.Adam([theirs], fused=True)
    for step in range(40):
        adam.learning_rate = reference.param_groups[0]["lr"] = 0.01 / (1 + step)
        gradient = torch.randn(500, generator=generator)
        mine_gradient.copy_(gradient)
        theirs.grad = gradient
        adam.step()
        reference.step()
        assert torch.equal(mine, theirs.detach()), step


def test_a_state_carries_over_and_stands_alone() -> None:
    mine = torch.ones(8)
    gradient = torch.full((8,), 0.5)
    adam = Adam(mine, gradient)
    adam.step()
    state, parameters = adam.get_state(), mine.clone()
    restored = Adam(parameters, gradient)
    adam.step()
    restored.set_state(state)
    restored.step()
    assert torch.equal(mine, parameters)


def test_no_private_name_of_pytorch_is_used() -> None:
    private = re.compile(r"(from )?(torch|nn)(\.\w+)*(\.| import )(_[a-z]\w*|ops)\b")
    found = [
        f"{path.name}:{node.lineno}: {name}"
        for path in (Path(drlsl.__file__).parent / "learning").rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text("utf-8")))
        if isinstance(node, ast.Attribute | ast.ImportFrom) and private.match(name := ast.unparse(node))
    ]
    assert found == []


def test_pytorch_is_bounded_for_the_functional_form_of_adam() -> None:
    project = (Path(drlsl.__file__).parents[1] / "pyproject.toml").read_text("utf-8")
    assert '"torch>=2.4,<3"' in project


def test_a_mean_that_shrinks_becomes_zero() -> None:
    gradient = torch.full((8,), 1e-30)
    adam = Adam(torch.ones(8), gradient)
    adam.step()
    gradient.zero_()
    for _ in range(400):
        adam.step()
    assert adam.get_state()["mean"].count_nonzero() == 0


def test_numbers_are_flushed_in_a_step_alone() -> None:
    smallest = math.ulp(0.0)
    with no_subnormals():
        assert smallest * 1.0 == 0.0
        with no_subnormals():
            pass
        assert smallest * 1.0 == 0.0
    assert smallest * 1.0 > 0.0
