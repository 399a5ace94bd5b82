"""What the command line says of itself: the lists in full, and the help of every command."""

from __future__ import annotations

import re
from pathlib import Path

import click
import pytest
import typer.main
from typer.testing import CliRunner, Result

from ninedisk.harness.api.capabilities import Capability
from ninedisk.harness.api.params import allowed, format_value
from ninedisk.harness.api.registry import BUILTIN_CASES, BUILTIN_ENGINES, get_case, get_engine
from ninedisk.harness.api.text import some
from ninedisk.harness.cli.app import app


def ninedisk(*arguments: str) -> Result:
    return CliRunner().invoke(app, list(arguments), prog_name="ninedisk")


def commands() -> dict[str, click.Command]:
    """Every command and group by its words, the empty ones being ``ninedisk`` itself."""

    def below(words: str, command: click.Command) -> dict[str, click.Command]:
        found = {words: command}
        for name, child in getattr(command, "commands", {}).items():
            found |= below(f"{words} {name}".strip(), child)
        return found

    return below("", typer.main.get_command(app))


def squeezed(text: str) -> str:
    """Without white space, where a table breaks its lines."""
    return re.sub(r"\s+", "", text)


def test_list_of_engines() -> None:
    done = ninedisk("list", "engines")
    assert done.exit_code == 0
    assert "broken" not in done.output
    rows = {line.split()[0]: "" for line in done.output.splitlines() if line.split()[:1]}
    for engine_id in BUILTIN_ENGINES:
        assert engine_id in rows, engine_id
        info = get_engine(engine_id).info()
        for word in (info.name, info.licence, info.contact, info.install):
            assert squeezed(word)[:8] in squeezed(done.output), word


def test_list_of_cases() -> None:
    done = ninedisk("list", "cases")
    assert done.exit_code == 0
    assert "broken" not in done.output
    for case_id in BUILTIN_CASES:
        assert case_id in done.output, case_id


@pytest.mark.parametrize("engine_id", BUILTIN_ENGINES)
def test_one_engine_in_full(engine_id: str) -> None:
    done = ninedisk("list", "engines", engine_id)
    assert done.exit_code == 0, done.output
    info = get_engine(engine_id).info()
    can, lacks = done.stdout.split("It can express:")[1].split("It lacks:")
    for capability in Capability:
        assert str(capability) in (can if capability in info.capabilities else lacks), capability
    for name, option in info.options.items():
        assert squeezed(f"{info.id}.{name}") in squeezed(done.stdout)
        assert option.allowed
        assert option.why


@pytest.mark.parametrize("case_id", BUILTIN_CASES)
def test_one_case_in_full(case_id: str) -> None:
    done = ninedisk("list", "cases", case_id)
    assert done.exit_code == 0, done.output
    case, text = get_case(case_id), squeezed(done.stdout)
    assert squeezed(case.requirement) in text
    for parameter in case.parameters:
        for word in (parameter.name, format_value(parameter.default), parameter.help):
            assert word, parameter.name
        assert parameter.name in done.stdout
        assert allowed(parameter)
    assert f"{some(len(case.matrix()), 'variant')} run by default" in done.stdout


@pytest.mark.parametrize("words", commands())
def test_help_documents_every_argument_and_option(words: str) -> None:
    done = ninedisk(*words.split(), "--help")
    assert done.exit_code == 0, done.output
    assert "Traceback" not in done.output
    command = commands()[words]
    assert command.help, words
    text = done.output
    paragraphs = [part for part in command.help.split("\n\n") if not part.startswith("\b")]
    assert not any("  " in " ".join(part.split("\n")) for part in paragraphs), (
        "a paragraph is indented: it is printed with its gaps"
    )
    for parameter in command.params:
        if getattr(parameter, "hidden", False):
            continue
        if parameter.param_type_name == "option":
            assert all(name in text for name in parameter.opts), parameter.opts
        said = getattr(parameter, "help", None)
        assert said, f"{words}: {parameter.name} has no help"
        assert squeezed(said)[:24] in squeezed(text), f"{words}: {parameter.name}"
    for child in getattr(command, "commands", {}):
        assert child in text


@pytest.mark.tree
def test_readme_lists_every_command() -> None:
    text = (Path(__file__).parents[3] / "README.md").read_text()
    for words, command in commands().items():
        if words and not getattr(command, "commands", {}):
            assert f"ninedisk {words}" in text, words
