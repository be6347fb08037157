import torch

from drlsl.learning.adam import Adam


def test_it_is_pytorchs_adam_to_the_bit() -> None:
    generator = torch.Generator().manual_seed(0)
    mine = torch.randn(500, generator=generator)
    theirs = torch.nn.Parameter(mine.clone())
    adam, reference = Adam(mine), torch.optim.Adam([theirs], fused=True)
    for step in range(40):
        adam.learning_rate = reference.param_groups[0]["lr"] = 0.01 / (1 + step)
        gradient = torch.randn(500, generator=generator)
        adam.gradient.copy_(gradient)
        theirs.grad = gradient
        adam.step()
        reference.step()
        assert torch.equal(mine, theirs.detach()), step


def test_a_state_carries_over_and_stands_alone() -> None:
    mine = torch.ones(8)
    adam = Adam(mine)
    adam.gradient.fill_(0.5)
    adam.step()
    state, parameters = adam.get_state(), mine.clone()
    restored = Adam(parameters)
    adam.step()
    restored.set_state(state)
    restored.gradient.fill_(0.5)
    restored.step()
    assert torch.equal(mine, parameters)
