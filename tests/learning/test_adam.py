import ast
import math
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
import torch

import drlsl
from drlsl.learning.adam import Adam, CompiledAdam, no_subnormals


def steps_beside_pytorchs(kind: type[Adam]) -> Iterator[tuple[torch.Tensor, torch.Tensor]]:
    """Yield the parameters after each of 40 steps, and those that PyTorch's own class gives."""
    generator = torch.Generator().manual_seed(0)
    mine = torch.randn(500, generator=generator)
    theirs = torch.nn.Parameter(mine.clone())
    mine_gradient = torch.zeros(500)
    adam, reference = kind(mine, mine_gradient), torch.optim.Adam([theirs], fused=True)
    for step in range(40):
        adam.learning_rate = reference.param_groups[0]["lr"] = 0.01 / (1 + step)
        gradient = torch.randn(500, generator=generator)
        mine_gradient.copy_(gradient)
        theirs.grad = gradient
        adam.step()
        reference.step()
        yield mine, theirs.detach()


def test_it_is_pytorchs_adam_to_the_bit() -> None:
    assert all(torch.equal(mine, theirs) for mine, theirs in steps_beside_pytorchs(Adam))


def test_as_machine_code_it_is_pytorchs_but_for_rounding() -> None:
    for mine, theirs in steps_beside_pytorchs(CompiledAdam):
        torch.testing.assert_close(mine, theirs, rtol=1e-6, atol=1e-7)


@pytest.mark.parametrize("kind", [Adam, CompiledAdam])
@pytest.mark.parametrize("other", [Adam, CompiledAdam])
def test_a_state_carries_over_and_stands_alone(kind: type[Adam], other: type[Adam]) -> None:
    mine = torch.ones(8)
    gradient = torch.full((8,), 0.5)
    adam = kind(mine, gradient)
    adam.step()
    state, parameters = adam.get_state(), mine.clone()
    restored = other(parameters, gradient)
    adam.step()
    restored.set_state(state)
    restored.step()
    torch.testing.assert_close(mine, parameters, rtol=0.0 if kind is other else 1e-6, atol=0.0)


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


@pytest.mark.parametrize("kind", [Adam, CompiledAdam])
def test_a_mean_that_shrinks_becomes_zero(kind: type[Adam]) -> None:
    gradient = torch.full((8,), 1e-30)
    adam = kind(torch.ones(8), gradient)
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
