"""A bad value of any option of any command: a message and exit code 2, never a traceback, a wrong number or half a file."""

from __future__ import annotations

from pathlib import Path

import click
import pytest
import typer.main
from typer.testing import CliRunner

from ninedisk.harness.cli import app

VALUES = ("", " ", "-1", "0.5", "nan", "1e400", "\x00x", "no/such/place", "é", "a=b=c", "--", "*", "9" * 400)
"""What no option means; a text option may take some, and then says what it could not find."""

PLACES = ("", "\x00x", "9" * 400)
"""Names that no file has; any other is one."""
FILES = (
    "--out",
    "--json",
    "--html",
    "--markdown",
    "--junit",
    "--csv",
    "--guides",
    "--published",
    "--record",
    "--scratch",
)

NEEDED = {
    "run": ["fake/fall", "-e", "fake-good"],
    "converge": ["fake/fall"],
    "request": ["fake/fall"],
    "compare": ["a", "b"],
    "check-engine": ["fake-good"],
}
"""Arguments with which a command goes no further than a bad option needs."""

SLOW = ("bench", "selftest", "docs", "check-engine", "converge")
"""Commands that take minutes where an odd value happens to be a right one: not tried here."""


def commands() -> dict[str, click.Command]:
    def below(words: str, command: click.Command) -> dict[str, click.Command]:
        children = getattr(command, "commands", {})
        found = {} if children else {words: command}
        for name, child in children.items():
            found |= below(f"{words} {name}".strip(), child)
        return found

    return below("", typer.main.get_command(app))


def options() -> list[tuple[str, str]]:
    """Every option of every command that takes a value."""
    return [
        (words, parameter.opts[0])
        for words, command in commands().items()
        if words not in SLOW
        for parameter in command.params
        if parameter.param_type_name == "option" and not getattr(parameter, "is_flag", False)
    ]


def test_there_are_options() -> None:
    assert len(options()) >= 15


@pytest.mark.usefixtures("fakes")
@pytest.mark.parametrize(("words", "option"), options())
def test_odd_values_of_every_option(words: str, option: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for value in PLACES if "store" in option or option in FILES else VALUES:
        done = CliRunner().invoke(app, [*words.split(), *NEEDED.get(words, []), option, value], prog_name="ninedisk")
        assert done.exception is None or isinstance(done.exception, SystemExit), (value, done.exception)
        assert "Traceback" not in done.output, value
        assert done.exit_code in (0, 1, 2, 3), (value, done.exit_code)
        if done.exit_code == 2:
            assert done.output.strip(), value
        left = [
            path for path in tmp_path.rglob("*") if path.is_file() and path.name.startswith(".") and path.stat().st_size
        ]
        assert not [path for path in left if path.suffix in (".tmp", ".part")], (value, left)
