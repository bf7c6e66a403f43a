"""Blocks of variables: each declared one is an attribute, whether it is there or not."""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pytest

from vsacli.base.variables import Block

BLOCK = Block(time=np.arange(3.0), tau_e=np.ones((3, 2)), q=np.zeros((3, 2)))


def test_variables_are_attributes():
    assert BLOCK.tau_e.shape == (3, 2)
    assert BLOCK.wrench is None
    assert list(BLOCK.arrays()) == ["time", "q", "tau_e"]
    assert {"tau_e", "q", "arrays"} <= set(dir(BLOCK))


@pytest.mark.parametrize("name", ["tau", "stiffnes"])
def test_nothing_else_is(name):
    with pytest.raises(AttributeError, match=f"no variable '{name}'"):
        getattr(BLOCK, name)
    with pytest.raises(TypeError, match=f"no variable is called {name}"):
        Block(**{name: np.zeros(3)})


@pytest.mark.parametrize(
    "copied", [copy.copy, copy.deepcopy, lambda block: pickle.loads(pickle.dumps(block))]
)
def test_copies_hold_the_same(copied):
    assert copied(BLOCK).arrays().keys() == BLOCK.arrays().keys()
