"""`drlsl study` with the fake tasks, as a process of its own that can be killed."""

import sys
from unittest import mock

from drlsl.cli import run
from drlsl.study import plan, tasks

from .fake import INPUTS, perform, study

if __name__ == "__main__":
    with (
        mock.patch.object(tasks, "perform", perform),
        mock.patch.object(tasks, "inputs_of", return_value={"digests": INPUTS["digests"]}),
        mock.patch.object(plan, "preset_study", return_value=study()),
    ):
        sys.exit(run(sys.argv[1:]))
