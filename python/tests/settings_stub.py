"""Generates lumiris/_settings.pyi from the table of settings: `python settings_stub.py > ../lumiris/_settings.pyi`."""

from __future__ import annotations

from lumiris import _lumiris

#: Types of the numbers in settings.
NUMBERS = {
    "int": "int",
    "float": "float",
    "pair": "Tuple[float, float]",
    # A name, with or without a number after a colon
    "graded": "str",
    "bytes": "Union[int, str]",
}


def value_type(row: _lumiris.SettingRow) -> str:
    """The Python type of a setting."""
    types = [NUMBERS[row["numbers"]]] if row["numbers"] else []
    names = [name for name in row["names"] if row["numbers"] != "graded"]
    if names:
        types.append(f"Literal[{', '.join(repr(name) for name in names)}]".replace("'", '"'))
    if row["has_bare"] or "off" in row["names"]:
        types.append("bool")
    return types[0] if len(types) == 1 else f"Union[{', '.join(types)}]"


def stub() -> str:
    """The text of the file."""
    lines = [
        '"""Types of the settings; made by tests/settings_stub.py."""',
        "",
        "from typing import Literal, Optional, Tuple, TypedDict, Union",
        "",
        "class Settings(TypedDict, total=False):",
        '    """The settings of an image; see `lumiris.settings()`."""',
        "",
    ]
    for name, row in _lumiris.settings().items():
        lines.append(f"    {name}: Optional[{value_type(row)}]")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    print(stub(), end="")
