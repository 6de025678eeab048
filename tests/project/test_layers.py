"""Rules of CONTRIBUTING.md that the source shows: which part may import which, and that data never becomes code."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import t2tl_jax

ROOT = Path(__file__).parents[2]
FILES = sorted(path for package in ("t2tl_jax", "envs", "experiments") for path in (ROOT / package).rglob("*.py"))

# The languages of tasks, which the compiler reads; they know nothing of it.
LTL_BASICS = {
    f"t2tl_jax.ltl.{name}" for name in ("errors", "formula", "co_safety", "parser", "reward_machine", "tokens")
}
# What every part may import: these know nothing of the others.
FOR_EVERYONE = {
    f"t2tl_jax.{name}"
    for name in ("checks", "names", "old_names", "errors", "flags", "garbage", "loaded", "quiet", "registry")
}
# What an environment needs of the library: its interface. It knows no temporal logic.
INTERFACE = {"t2tl_jax.env", "t2tl_jax.objects", "t2tl_jax.view"}
WORLD = {"t2tl_jax.ltl", "t2tl_jax.env", "t2tl_jax.objects", "t2tl_jax.task_env"}
# Learners are trained by pure functions; these know of networks only what a task encoder is.
LEARNING = WORLD | {"t2tl_jax.training", "t2tl_jax.networks.task_encoder"}
# What each part may import besides itself and these. A part is the longest entry that a module's name starts with.
MAY_IMPORT = {
    **{module: set() for module in FOR_EVERYONE},
    "t2tl_jax.ltl": set(),
    # Text -> parser -> formula -> compiler -> table: what comes before the compiler, and what it may know.
    **dict.fromkeys(LTL_BASICS, LTL_BASICS),
    "t2tl_jax.ltl.compiler": LTL_BASICS,
    "t2tl_jax.view": set(),
    "t2tl_jax.objects": set(),
    "t2tl_jax.env": {"t2tl_jax.view", "t2tl_jax.objects"},
    "t2tl_jax.task_env": {"t2tl_jax.env", "t2tl_jax.ltl", "t2tl_jax.objects"},
    "t2tl_jax.wrappers": {"t2tl_jax.env", "t2tl_jax.task_env"},
    "t2tl_jax.renaming": {"t2tl_jax.env", "t2tl_jax.objects"},
    # The world of pre-training, which is a part of the method.
    "t2tl_jax.single_state": {"t2tl_jax.env"},
    "t2tl_jax.networks": {"t2tl_jax.ltl", "t2tl_jax.objects"},
    "t2tl_jax.networks.task_encoder": {"t2tl_jax.ltl"},
    "t2tl_jax.training": LEARNING,
    "t2tl_jax.agents": LEARNING | {"t2tl_jax.networks"},
    # The one learner that knows its world, which it solves.
    "t2tl_jax.agents.dp": LEARNING | {"t2tl_jax.agents", "t2tl_jax.networks", "t2tl_jax.single_state"},
    "t2tl_jax.evaluation": LEARNING | {"t2tl_jax.view"},
    # What a network attends to is asked of the network itself.
    "t2tl_jax.evaluation.attention": LEARNING | {"t2tl_jax.evaluation", "t2tl_jax.networks"},
    "t2tl_jax.runs": LEARNING
    | INTERFACE
    | {"t2tl_jax.agents", "t2tl_jax.evaluation", "t2tl_jax.networks.state_encoder"}
    | {"t2tl_jax.renaming", "t2tl_jax.single_state"},
    # The one configuration of the library itself, with a network of its own.
    "t2tl_jax.runs.pretraining_schedule": {
        *("t2tl_jax.runs.config", "t2tl_jax.runs.convergence", "t2tl_jax.single_state"),
        *("t2tl_jax.agents", "t2tl_jax.networks"),
    },
    "t2tl_jax": {"t2tl_jax"},  # the face
    "envs": INTERFACE,
    "experiments": {"t2tl_jax", "envs"},
}
FACE = "t2tl_jax"
OWN = ("t2tl_jax", "envs", "experiments")
FORBIDDEN_MODULES = {"pickle", "cPickle", "dill", "cloudpickle", "joblib", "shelve", "marshal"}
FORBIDDEN_CALLS = {"eval", "exec", "compile", "__import__"}


def within(module: str, part: str) -> bool:
    return module == part or module.startswith(part + ".")


def imported(tree: ast.AST) -> set[str]:
    """Every module that a file imports, also inside functions; of `from a import b` both `a` and `a.b`."""
    modules = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            modules |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "imports are absolute here"
            assert node.module is not None
            modules |= {node.module} | {f"{node.module}.{alias.name}" for alias in node.names}
    return modules


def module_name(path: Path) -> str:
    return ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")


def forbidden_imports(module: str, modules: set[str]) -> set[str]:
    """Own modules among `modules` that `module` may not import. A bare package is fine if something in it is."""
    parts = [part for part in MAY_IMPORT if within(module, part)]
    assert parts, f"{module} belongs to no part of MAY_IMPORT"
    part = max(parts, key=len)
    assert part != FACE or module == FACE, f"{module} belongs to no part of MAY_IMPORT"
    allowed = MAY_IMPORT[part] | FOR_EVERYONE | {part}
    own = {name for name in modules if any(within(name, package) for package in OWN)}
    fine = {name for name in own if any(within(name, other) for other in allowed)}
    return {name for name in own - fine if not any(within(other, name) for other in fine)}


@pytest.mark.slow
def test_imports_go_one_way():
    trees = {module_name(path): ast.parse(path.read_text(encoding="utf-8")) for path in FILES}
    offences = {module: forbidden_imports(module, imported(tree)) for module, tree in trees.items()}
    assert len(offences) > 50 and not {module: names for module, names in offences.items() if names}


@pytest.mark.slow
def test_brax_is_loaded_in_one_place_which_silences_it():
    loading = {path for path in FILES if any(within(name, "brax") for name in imported(ast.parse(path.read_text())))}
    assert loading == {ROOT / "t2tl_jax" / "env.py"}


@pytest.mark.parametrize(
    ("module", "statement", "forbidden"),
    [
        ("t2tl_jax.ltl.parser", "from t2tl_jax.env import LabelledEnv", True),
        ("t2tl_jax.ltl.parser", "import flax.struct", False),
        ("t2tl_jax.ltl.parser", "from t2tl_jax.ltl.compiler.budget import Budget", True),
        ("t2tl_jax.ltl.compiler.core", "from t2tl_jax.ltl import table", True),
        ("envs.zones", "from t2tl_jax.names import nearest", False),
        ("envs.zones", "from t2tl_jax.registry import register_env", False),
        ("envs.zones", "from t2tl_jax.env import LabelledEnv", False),
        ("envs.zones", "from t2tl_jax import LabelledEnv", True),  # which may be anything of the face
        ("envs.zones", "from t2tl_jax.ltl import TaskTable", True),
        ("envs.zones", "from t2tl_jax.task_env import TaskEnv", True),
        ("t2tl_jax.registry", "from t2tl_jax.runs.config import Config", True),
        ("t2tl_jax.env", "from t2tl_jax.ltl import TaskTable", True),
        ("t2tl_jax.task_env", "from envs.zones import ZoneEnv", True),
        ("t2tl_jax.single_state", "from t2tl_jax.ltl import TaskTable", True),
        ("t2tl_jax.runs.pretraining", "from t2tl_jax.networks.actor_critic import NetworkConfig", True),
        ("t2tl_jax.runs.pretraining_schedule", "from t2tl_jax.networks.actor_critic import NetworkConfig", False),
        ("t2tl_jax.networks.transformer", "from t2tl_jax.agents import ppo", True),
        ("t2tl_jax.networks.transformer", "from t2tl_jax.task_env import TaskEnv", True),
        ("t2tl_jax.training.types", "from t2tl_jax.networks.task_encoder import TaskEncoderConfig", False),
        ("t2tl_jax.training.types", "from t2tl_jax.networks.actor_critic import NetworkConfig", True),
        ("t2tl_jax.training.program", "from t2tl_jax.agents import ppo", True),
        ("t2tl_jax.agents.ppo", "import experiments.configs", True),
        ("t2tl_jax.agents.ppo", "def f():\n    from t2tl_jax import evaluation", True),
        ("t2tl_jax.evaluation.curves", "from t2tl_jax.runs.metrics_file import history", True),
        ("t2tl_jax.runs.train", "from t2tl_jax import train", True),
        ("t2tl_jax.runs.train", "from t2tl_jax.agents.ppo_config import PPOConfig", False),
        ("t2tl_jax.runs.train", "import envs.zones", True),
        ("t2tl_jax", "from t2tl_jax.runs.train import train", False),
        ("t2tl_jax", "from envs.zones import ZoneEnv", True),
        ("experiments.run", "from t2tl_jax.agents import ppo", False),
    ],
)
def test_the_check_notices(module, statement, forbidden):
    assert bool(forbidden_imports(module, imported(ast.parse(statement)))) == forbidden


@pytest.mark.slow
def test_no_code_comes_from_data():
    for path in FILES:
        tree = ast.parse(path.read_text(encoding="utf-8"))
        assert not {name.split(".")[0] for name in imported(tree)} & FORBIDDEN_MODULES, path
        for call in (node for node in ast.walk(tree) if isinstance(node, ast.Call)):
            called = call.func.id if isinstance(call.func, ast.Name) else ""
            assert called not in FORBIDDEN_CALLS, f"{path}:{call.lineno}"
            assert "allow_pickle" not in {keyword.arg for keyword in call.keywords}, f"{path}:{call.lineno}"


def test_the_face_names_what_is_there_and_loads_nothing_by_itself():
    tree = ast.parse((ROOT / "t2tl_jax" / "__init__.py").read_text(encoding="utf-8"))
    (for_checkers,) = (node for node in tree.body if isinstance(node, ast.If))
    shown = {
        alias.name: node.module
        for node in for_checkers.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    assert shown == {name: f"t2tl_jax.{home}" for name, home in t2tl_jax._HOME.items()}
    assert all(getattr(t2tl_jax, name) is not None for name in t2tl_jax.__all__)
    check = "import sys, t2tl_jax; print(sorted({'jax', 'mujoco', 'flax', 'numpy'} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", check], capture_output=True, text=True, cwd=ROOT, timeout=60)
    assert done.stdout == "[]\n", done.stdout + done.stderr
