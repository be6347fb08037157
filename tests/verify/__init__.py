"""Tests of drlsl.verify; they need z3-solver, the extra `verify`."""

import pytest

pytest.importorskip("z3", reason="proofs need z3-solver, the extra verify")
