"""The output of a cell as one text, however the kernel has sent it.

myst-nb's own setting, `nb_merge_streams`, breaks the line wherever a message of the kernel ends, and drops empty lines;
nbclient joins the messages as they are, but myst-nb has no setting for it.
"""

from __future__ import annotations

import functools

from nbclient import NotebookClient
from sphinx.application import Sphinx


def setup(_app: Sphinx) -> dict[str, bool]:
    NotebookClient.__init__ = functools.partialmethod(NotebookClient.__init__, coalesce_streams=True)  # type: ignore[method-assign]
    return {"parallel_read_safe": True, "parallel_write_safe": True}
