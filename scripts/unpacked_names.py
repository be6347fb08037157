"""Make Griffe see names that are assigned together, as in `A, B = 1, 2`, which it ignores."""

from __future__ import annotations

import ast
from typing import Any

import griffe


class UnpackedNames(griffe.Extension):
    """Extension that adds an attribute to a module for each name in an assignment to several names."""

    def on_module_members(self, *, node: Any, mod: griffe.Module, **_others: Any) -> None:
        """Add the missing names to a module that was read from its source."""
        if not isinstance(node, ast.Module):
            return
        for statement in node.body:
            if not (isinstance(statement, ast.Assign) and isinstance(statement.targets[0], ast.Tuple)):
                continue
            for target in statement.targets[0].elts:
                if isinstance(target, ast.Name) and target.id not in mod.members:
                    mod.set_member(target.id, griffe.Attribute(target.id, lineno=statement.lineno))
