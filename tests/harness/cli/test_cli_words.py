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
from ninedisk.harness.api.registry import BUILTIN_CASES, BUILTIN_ENGINES, engine_table, get_case, get_engine
from ninedisk.harness.api.text import count_noun
from ninedisk.harness.cli.app import FIRST, MORE, app


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
    assert f"{count_noun(len(case.matrix()), 'variant')} run by default" in done.stdout


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


LEVELS = ("list", "run", "report", "check-engine", "audit", "compare", "converge", "findings", "bench", "new-engine")


def test_the_first_help_explains_ten_commands_and_names_the_others() -> None:
    done = ninedisk("--help")
    first, more = done.stdout.split("\nCommands:\n")[1].split("\nMore ")
    shown = [line.split() for line in first.splitlines() if re.match(r"  \S", line)]
    assert [words[0] for words in shown] == list(LEVELS)
    assert all(len(words) > 3 for words in shown), "each with what it does"
    others = [words for words in commands() if words and " " not in words and words not in LEVELS]
    named = re.findall(r"[a-z-]+", " ".join(line.split("  ")[-1] for line in more.splitlines()[1:]))
    assert sorted(named) == sorted(others)
    assert set(FIRST) | {name for names in MORE.values() for name in names} == {*LEVELS, *others}


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ("rum", "Did you mean 'run'"),
        ("rum", "`ninedisk --help` lists all"),
        ("cases", "Did you mean 'list cases'"),
        ("list engine", "Did you mean 'engines'"),
        ("list engine", "`ninedisk list --help` lists all"),
        ("cd-problems mak", "Did you mean 'make'"),
        ("run binary-colision", "Did you mean 'binary-collision'"),
        ("run binary-colision", "`ninedisk list cases` shows all"),
        ("run binary-collision -e pymnk", "Did you mean 'pymunk'"),
        ("run binary-collision -e pymnk", "`ninedisk list engines` shows all"),
        ("run binary-collision -e dem --set kidn=plastic", "Did you mean 'kind'"),
        ("run binary-collision -e dem --set kidn=plastic", "`ninedisk list cases binary-collision`"),
        ("run binary-collision -e dem --set kind=plastc", "Did you mean 'plastic'"),
        ("run impact/* -e dem --set restituton=1", "Did you mean 'restitution'"),
        ("run impact/* -e dem --set restituton=1", "`ninedisk list cases CASE` shows"),
        ("run * -e dem --set no_such=1", ", ...) has a parameter"),
        ("run binary-collision -e pymunk --option iteratons=3", "Did you mean 'pymunk.iterations'"),
        ("run binary-collision -e pymunk --option iteratons=3", "`ninedisk list engines ENGINE` shows"),
        ("run binary-collision -e pymunk --option pymunk.iteratons=3", "Did you mean 'iterations'"),
        ("run binary-collision -e pymunk --option pymunk.iteratons=3", "`ninedisk list engines ENGINE` explains"),
        ("run binary-collision -e pymunk --option pymnk.iterations=3", "Did you mean 'pymunk'"),
        ("converge binary-colision", "Did you mean 'binary-collision'"),
        ("converge binary-collision -e pymnk", "Did you mean 'pymunk'"),
        ("request binary-collision --set kidn=plastic", "Did you mean 'kind'"),
        ("check-engine pymnk", "Did you mean 'pymunk'"),
        ("determinism -e pymnk", "Did you mean 'pymunk'"),
        ("list cases binary-colision", "Did you mean 'binary-collision'"),
        ("list engines pymnk", "Did you mean 'pymunk'"),
        ("show --status known-gpa", "Did you mean 'known-gap'"),
        ("show --status known-gpa", "`ninedisk list statuses` explains them"),
        ("bench flwo", "Did you mean 'flow'"),
        ("solve x.npz --solver interior-pont", "Did you mean 'interior-point'"),
        ("solve x.npz --sliding coulmb", "Did you mean 'coulomb'"),
        ("cd-problems make --family settlng", "Did you mean 'settling'"),
        ("cd-problems make --form fclb", "Did you mean 'fclib'"),
        ("new-engine x --language javscript", "Did you mean 'javascript'"),
        ("selftest --only dem/torqe-sign", "Did you mean 'dem/torque-sign'"),
        ("run --enigne dem", "--engine"),
    ],
)
def test_what_is_misspelt_gets_near_names_and_the_remedy(
    arguments: str, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    done = ninedisk(*arguments.split())
    assert done.exit_code == 2, done.output
    assert said in " ".join(done.stderr.split())
    assert "Traceback" not in done.output
    assert len(done.stderr) < 6000
    assert not list(tmp_path.iterdir())


def test_one_is_singular() -> None:
    one = next(case_id for case_id in BUILTIN_CASES if len(get_case(case_id).matrix()) == 1)
    assert "\n1 variant run by default" in ninedisk("list", "cases", one).stdout
    engine = ninedisk("list", "engines", "dem").stdout
    assert "1 thread\n" in engine
    assert f"\n{len(engine_table())} engines; " in ninedisk("list", "engines").stdout


def test_tables_have_short_numbers_and_commands_have_all_digits() -> None:
    shown = ninedisk("list", "cases", "binary-collision").stdout
    assert re.search(r"^ mass +3\.142 ", shown, re.MULTILINE)
    variants = ninedisk("list", "cases", "nine-disk/distortion").stdout
    assert "ks_over_kn=0.6667" in variants
    longest = max(len(digits) for digits in re.findall(r"\d\.(\d+)", variants.partition("example:")[0]))
    assert longest <= 5


@pytest.mark.tree
def test_the_reference_lists_every_command() -> None:
    text = (Path(__file__).parents[3] / "docs" / "reference" / "command-line.md").read_text()
    for words, command in commands().items():
        if words and not getattr(command, "commands", {}):
            assert f"ninedisk {words}" in text, words
