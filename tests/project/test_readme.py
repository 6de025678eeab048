"""What README and docs say exists: links, files, modules, names, flags; nothing here trains."""

import ast
import dataclasses
import importlib
import importlib.util
import re
import shlex
import sys
from pathlib import Path

import jax
import pytest

from experiments import sweep
from experiments.cli import hosts, request
from t2tl_jax import registry
from t2tl_jax.errors import UserError
from t2tl_jax.flags import _fields
from t2tl_jax.ltl import compile_tasks
from t2tl_jax.runs.config import Config, Task
from t2tl_jax.task_env import TaskEnv

ROOT = Path(__file__).parents[2]
README = ROOT / "README.md"
PAGES = [README, ROOT / "CONTRIBUTING.md", ROOT / "CHANGELOG.md", *sorted((ROOT / "docs").glob("*.md"))]
NAMES_OF_THEN = {"migration.md", "CHANGELOG.md"}
"""Pages that also name what is gone."""

SNIPPETS = re.compile(r"^```python\n(.*?)^```", re.M | re.S)
STANDING_FOR = {"METHOD": "t2tl", "RUN/config.json": str(ROOT / "results" / "any" / "any-letters" / "config.json")}
"""Of words that stand for something, one such thing."""

PARTS = ("t2tl_jax/", "envs/", "experiments/", "tests/", "results/", "docs/", ".ci/")
each_page = pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)


def text_of(page):
    return page.read_text(encoding="utf-8")


def slug(heading):
    """What GitHub calls the anchor of a heading."""
    return re.sub(r"[^\w\- ]", "", heading.strip().lower()).replace(" ", "-")


def anchors(page):
    return {slug(heading) for heading in re.findall(r"^#+ (.*)$", text_of(page), re.M)}


def commands(page, pattern=r"python3? -m ([\w.]+)"):
    """Module and words of every command of the page, in blocks of code and in single quotes of code."""
    text = text_of(page).replace("\\|", "|")
    lines = [line for block in re.findall(r"^```sh\n(.*?)^```", text, re.M | re.S) for line in block.splitlines()]
    lines += [line.strip() for line in text.splitlines() if line.startswith("    python")]
    lines += [" ".join(quoted.split()) for quoted in re.findall(r"`(python3? -m [^`]+)`", text)]
    for line in lines:
        for command in re.split(r"&&| \| ", re.sub(r"\[[^\]]*\]", "", line)):
            found = re.search(pattern, command)
            if found:
                yield found.group(1), shlex.split(command[found.end() :], comments=True)


def flags_of(words):
    words = words[: words.index("--")] if "--" in words else words  # what follows is another command's
    return [word.partition("=")[0] for word in words if word.startswith("--")]


@pytest.fixture
def corridor(tmp_path, monkeypatch):
    """The README's environment as a module that can be imported, without a trace of it afterwards."""
    monkeypatch.setattr(registry.ENVS, "_kinds", dict(registry.ENVS._kinds))
    source = next(code for code in SNIPPETS.findall(text_of(README)) if "register_env(" in code)
    (tmp_path / "my_corridor.py").write_text(source, encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    yield importlib.import_module("my_corridor")
    sys.modules.pop("my_corridor", None)


def test_readme_is_short():
    assert len(text_of(README).splitlines()) <= 150


@each_page
def test_nothing_is_left_to_fill_in(page):
    """Figures that are still to be measured stand as names between two pairs of at signs."""
    assert sorted(set(re.findall(r"@@\w*@@", text_of(page)))) == []


@each_page
def test_lines_fit(page):
    """Paragraphs are no wider than code; tables, commands and pictures have to be on one line."""
    outside = re.sub(r"^```.*?^```", "", text_of(page), flags=re.M | re.S).splitlines()
    assert not [line for line in outside if len(line) > 120 and not line.startswith(("|", "    ", "!"))]


@each_page
def test_links_lead_somewhere(page):
    for target in re.findall(r"\]\(([^)\s]+)\)", text_of(page)):
        if target.startswith("https://") or "@@" in target:
            continue
        file, _, anchor = target.partition("#")
        there = (page.parent / file).resolve() if file else page
        assert there.is_relative_to(ROOT) and there.exists(), target
        assert not anchor or anchor in anchors(there), target


@each_page
def test_files_exist(page):
    for name in re.findall(r"`([\w./-]+)`", text_of(page)):
        if name.startswith(PARTS):
            assert (ROOT / name).exists(), name


@pytest.mark.parametrize(
    ("page", "code"),
    [
        pytest.param(page, code, id=f"{page.name}-{number}")
        for page in PAGES
        for number, code in enumerate(SNIPPETS.findall(text_of(page)))
    ],
)
def test_snippets_are_python_and_their_imports_exist(page, code):
    for node in ast.walk(ast.parse(code, page.name)):
        if isinstance(node, ast.Import):
            for alias in node.names:
                importlib.import_module(alias.name)
        if isinstance(node, ast.ImportFrom):
            module = importlib.import_module(node.module)
            assert not [alias.name for alias in node.names if not hasattr(module, alias.name)], node.module


@each_page
def test_modules_exist(page):
    for module, _ in commands(page):
        assert importlib.util.find_spec(module) is not None, module


@each_page
def test_training_commands_are_understood(page, corridor):
    """Configuration, method and every flag, read as the command itself reads them, but for names of folders."""
    for module, words in commands(page):
        if module == "experiments.sweep":
            assert (plan := sweep.read(sweep.split(words))).points or plan.space
        prefix = {"experiments.run": "", "experiments.pretrain": "pretrain_"}.get(module)
        if prefix is None or "--resume" in words:
            continue
        words, _ = hosts.read(words, {})
        asked = request.read([STANDING_FOR.get(word, word) for word in words], prefix)
        if not asked.show_list:
            request.configuration(asked, prefix, module)


@each_page
def test_flags_of_other_commands_exist(page):
    """Those of the commands that have a dataclass named Arguments."""
    for name, words in commands(page):
        if name.startswith("experiments."):
            arguments = getattr(importlib.import_module(name), "Arguments", None)
            known = dict(_fields(arguments)) if arguments else dict.fromkeys(flags_of(words))
            families = [flag for flag, hint in known.items() if hint is Task]
            for kind in registry.TASK_FAMILIES.classes():
                known |= {flag: hint for family in families for flag, hint in _fields(kind, f"{family}.")}
            assert not set(flags_of(words)) - set(known), name


@each_page
def test_fields_that_are_named_exist(page, corridor):
    """Flags of a configuration's parts, wherever they are quoted: some named configuration or kind has each of them."""
    if page.name in NAMES_OF_THEN:
        pytest.skip("names of earlier versions")
    known = set(request.CHOOSING)
    for config, _ in registry.configs().values():
        parts = [(config, "--")]
        for name, kinds in (("env", registry.ENVS), ("learner", registry.AGENTS)):
            parts += [(kind, f"--{name}.") for kind in kinds.classes()]
        parts += [(kind, "--learner.network.task-encoder.") for kind in registry.TASK_ENCODERS.classes()]
        known |= {flag for part, start in parts for flag, _ in _fields(part, start)}
    known |= {flag.rpartition(".")[0] for flag in known}
    wild = re.findall(r"--(?:learner|env|run|pool|convergence)\.[a-z][\w.-]*\w", text_of(page))
    assert not {flag for flag in wild if flag not in known}


def test_the_table_of_fields_is_that_of_the_configuration():
    table = text_of(ROOT / "docs" / "python.md").split("## Fields of Config")[1].split("\n## ")[0]
    rows = {name: default.strip("` ") for name, default in re.findall(r"^\| `(\w+)` \|([^|]*)\|", table, re.M)}
    fields = {field.name: field for field in dataclasses.fields(Config)}
    assert sorted(rows) == sorted(fields)
    for name, shown in rows.items():
        if fields[name].default is dataclasses.MISSING:
            made = fields[name].default_factory
            assert shown == ("" if made is dataclasses.MISSING else f"{made.__name__}()"), name
        else:
            assert ast.literal_eval(shown.replace(",", "")) == fields[name].default, name


def test_the_checks_see_the_commands():
    """Nothing above passes because nothing was found."""
    modules = {page.name: [module for module, _ in commands(page)] for page in PAGES}
    assert modules["README.md"].count("experiments.run") >= 3 and "venv" in modules["README.md"]
    assert modules["results.md"].count("experiments.run") >= 5 and modules["methods.md"].count("experiments.run") >= 3
    assert modules["results.md"].count("experiments.reproduce") >= 10
    assert {"experiments.evaluate", "experiments.attention", "experiments.pretrain"} <= set(modules["usage.md"])
    mistaken = ["--config", "zone_ppo", "--ppo.clip", "0.1"]
    with pytest.raises(UserError, match=r"unknown option '--ppo\.clip'"):
        request.configuration(request.read(mistaken), "", "experiments.run")


def test_the_readme_s_environment_works(corridor):
    env = registry.make_env("corridor")
    assert [field.name for field in dataclasses.fields(corridor.CorridorConfig)] == ["speed"]
    task_env = TaskEnv(env, compile_tasks("F(Lamp & F Door)", env.propositions, env.alphabet))
    state = jax.jit(task_env.reset)(jax.random.key(0))
    step = jax.jit(task_env.step)
    for direction, goal in ((-1.0, 0), (1.0, 1)):
        while not env.labels(state.replace(pipeline_state=state.pipeline_state.env))[goal]:
            state = step(state, jax.numpy.full(1, direction))
    assert task_env.verdict(state) == 1 and state.reward == 1
