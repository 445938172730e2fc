"""Documentation of the module: types of the settings, and the examples."""

from __future__ import annotations

import contextlib
import io
import pathlib
import re
from typing import Any, Dict

import pytest

from conftest import ROOT
from settings_stub import stub


def test_types_of_settings_are_those_of_the_table() -> None:
    written = (ROOT / "python" / "lumiris" / "_settings.pyi").read_text()
    assert written == stub(), "python tests/settings_stub.py > lumiris/_settings.pyi"


def test_the_example_runs_and_prints_what_it_says(tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "scenes").symlink_to(ROOT / "scenes")
    monkeypatch.chdir(tmp_path)
    text = (ROOT / "docs" / "python.md").read_text()
    names: Dict[str, Any] = {"__name__": "example"}
    blocks = re.findall(r"^```python\n(.*?)^```\n(?:\n?```text\n(.*?)^```\n)?", text, re.MULTILINE | re.DOTALL)
    assert len(blocks) >= 6
    for code, expected in blocks:
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed):
            exec(compile(code, "docs/python.md", "exec"), names)
        assert not expected or printed.getvalue() == expected, code
