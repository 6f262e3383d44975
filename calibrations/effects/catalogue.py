"""The catalogue of effects: the shipped ones, and a user's own, each read from its file."""

from __future__ import annotations

import importlib
import importlib.util
import logging
import sys
import traceback
from collections.abc import Callable, Iterable, Mapping
from functools import cache, wraps
from pathlib import Path
from types import MethodType, ModuleType
from typing import Any

import numpy as np

from calibrations.effects.effect import HOOKS, Effect
from calibrations.errors import ModelError, UnknownName, nearest

LOG = logging.getLogger(__name__)  # warnings are printed to standard error by default
SHIPPED_FOLDERS = ("signal", "noise")  # folders
CHOSEN = "_chosen"  # of an effect that was made from a user's class


@cache
def catalogue(folder: Path | None = None) -> Mapping[str, Effect]:
    """Every effect by name: the shipped ones, and those of a user's `folder`.

    Raises ModelError for a file that is not an effect, naming what it lacks, and for one with a shipped one's name.
    """
    effects = {
        e.name: e
        for part in SHIPPED_FOLDERS
        for e in _read_folder(Path(__file__).parent / part, f"{__package__}.{part}")
    }
    effects = dict(sorted(effects.items()))
    if folder is not None:
        if not folder.is_dir():
            raise ModelError(f"{folder}: the folder of your own effects does not exist")
        if any(folder.glob("[!_]*.py")):
            LOG.warning("the Python files in %s are run: the bench file names this folder for effects", folder)
        user_effects = {e.name: e for e in _read_folder(folder, None)}
        if duplicates := sorted(effects.keys() & user_effects.keys()):
            raise ModelError(
                f"{folder}: {', '.join(duplicates)} is already in the catalogue; give your effect another name"
            )
        effects |= user_effects
    for effect in effects.values():
        for name in (*effect.after, *effect.contains):
            if name not in effects:
                raise ModelError(f'{effect.name}: there is no effect "{name}"{nearest(name, effects)}')
    return effects


def find(name: str, effects: Mapping[str, Effect]) -> Effect:
    """The effect of that name. Raises UnknownName with the nearest."""
    if name not in effects:
        raise UnknownName(f'unknown effect "{name}"{nearest(name, effects)}')
    return effects[name]


def with_own(user_effects: Iterable[Effect | type[Effect] | str | Path]) -> Mapping[str, Effect]:
    """The catalogue and the user's effects. Raises ModelError as `load_effect` does."""
    if isinstance(user_effects, (str, Path, Effect, type)):
        user_effects = (user_effects,)
    by_name = {effect.name: effect for effect in map(load_effect, user_effects)}
    return {**catalogue(), **by_name}


def load_effect(source: Effect | type[Effect] | str | Path) -> Effect:
    """An effect by its name in the catalogue, its file (.py), or as a class, such as one of a notebook's cell.

    Raises UnknownName with the nearest, ModelError for an incomplete effect, and for the name of a shipped one.
    """
    if isinstance(source, Path) or (isinstance(source, str) and source.endswith(".py")):
        return read_effect(Path(source))
    if isinstance(source, str):
        return find(source, catalogue())
    if isinstance(source, Effect) and (source is catalogue().get(source.name) or vars(source).get(CHOSEN)):
        return source
    cls = type(source) if isinstance(source, Effect) else source
    if not (isinstance(cls, type) and issubclass(cls, Effect)):
        raise ModelError(
            f"{source!r} is not an effect; give its name, its file, or a class that derives from cal.Effect"
        )
    return _class_effect(cls)


def _class_effect(cls: type[Effect]) -> Effect:
    """The effect of a user's class. A message names the class and the method where something fails."""
    effect = cls()
    _require_parts(effect, cls.__name__)
    if effect.name in catalogue():
        raise ModelError(f"{cls.__name__}: {effect.name} is already in the catalogue; give the class another name")
    first = next(iter((cls.__doc__ or "").strip().splitlines()), "")
    described = {
        "summary": effect.summary or first or "an effect of your own, not described",
        "formula": effect.formula or f"{cls.__name__}, formula not described",
        "symptom": effect.symptom or "not described",
    }
    guards = {
        method: MethodType(guard(getattr(cls, method), Path(_file(cls, method)), cls.__name__), effect)
        for method in (*effect.places, *(["follow"] if effect.memory else []))
    }
    vars(effect).update(described | guards | {CHOSEN: True})
    return effect


def _file(cls: type[Effect], method: str) -> str:
    """The file in which the method of a class was written, or the cell of a notebook."""
    return str(getattr(cls, method).__code__.co_filename)


def read_effect(path: Path) -> Effect:
    """A user's effect from its file. Raises ModelError for a file without one, and for the name of a shipped one."""
    if not path.is_file():
        raise ModelError(f"{path}: there is no such file; an effect of your own is a Python file")
    effect = _user_effect(path)
    if effect.name in catalogue():
        raise ModelError(f"{path}: {effect.name} is already in the catalogue; give the file another name")
    return effect


def _read_folder(folder: Path, package: str | None) -> Iterable[Effect]:
    for path in sorted(folder.glob("[!_]*.py")):
        yield _module_effect(importlib.import_module(f"{package}.{path.stem}"), path) if package else _user_effect(path)


def _user_effect(path: Path) -> Effect:
    """A user's effect, whose errors name the user's file."""
    effect = _module_effect(_load(path), path)
    for method in (*HOOKS, "follow"):
        if method in vars(type(effect)):
            setattr(type(effect), method, guard(vars(type(effect))[method], path))
    return effect


def _load(path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(f"user_effects_{path.stem}", path)
    if spec is None or spec.loader is None:
        raise ModelError(f"{path}: cannot be read as Python")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:
        raise fault(path, error) from error
    return module


def _module_effect(module: ModuleType, path: Path) -> Effect:
    """The effect of the one class in a module."""
    expected_name = class_name(path)
    classes = [v for v in vars(module).values() if isinstance(v, type) and v.__module__ == module.__name__]
    effects = [cls for cls in classes if issubclass(cls, Effect)]
    if [cls.__name__ for cls in effects] != [expected_name]:
        names = ", ".join(cls.__name__ for cls in effects) or "no effect"
        raise ModelError(
            f"{path}: must define one effect, `class {expected_name}(Effect):`; it defines {names}. "
            'See "An effect" in CONTRIBUTING.md'
        )
    effect = effects[0]()
    effect.name = path.stem.replace("_", "-")
    _require_parts(effect, f"{path}: {expected_name}")
    if not effect.summary or not effect.symptom:
        raise ModelError(
            f'{path}: the docstring of {expected_name} must begin with "{effect.name}: what happens." and have a line '
            '"Symptom ..."'
        )
    return effect


def _require_parts(effect: Effect, label: str) -> None:
    """Raise ModelError for an effect without a parameter, or without a place where it acts."""
    if not effect.parameters:
        raise ModelError(f'{label} has no parameter, as in slope = Parameter("{{out}}/K", typical=0.005)')
    if not effect.places:
        raise ModelError(f"{label} acts nowhere; define at least one of the methods {', '.join(HOOKS)}")


def class_name(path: Path) -> str:
    """The name of the class in an effect's file: `WormError` in worm_error.py."""
    return "".join(part.capitalize() for part in path.stem.split("_"))


def fault(path: Path, error: BaseException, name: str = "") -> ModelError:
    """`error`, raised in the file `path`, with the line where it was raised. Messages name the file, or `name`."""
    frames = traceback.extract_tb(error.__traceback__)
    lines = [frame.lineno for frame in frames if Path(frame.filename).absolute() == path.absolute()]
    line = error.lineno if isinstance(error, SyntaxError) else lines[-1] if lines else None
    place = f"{name or path}, line {line}" if line else name or str(path)
    if isinstance(error, ModelError):  # of a class that is no effect
        return ModelError(f"{place}: {error}")
    message = error.msg if isinstance(error, SyntaxError) else str(error)
    return ModelError(f"{place}: {type(error).__name__}: {message}")


def guard(hook: Callable[..., Any], path: Path, name: str = "") -> Callable[..., Any]:
    """The method `hook` of a user's effect. It raises ModelError where it fails, and where its result is not an array
    of finite numbers with the shape of its first argument. A pose is not checked. Messages name the file, or `name`.
    """

    @wraps(hook)
    def call(self: Effect, argument: Any, *others: Any) -> Any:
        try:
            result = hook(self, argument, *others)
        except Exception as error:
            raise fault(path, error, name) from error
        if isinstance(argument, np.ndarray):
            _check(result, argument, f"{name or path}: {hook.__name__}()")
        return result

    return call


def _check(result: Any, argument: np.ndarray, label: str) -> None:
    if np.shape(result) != argument.shape:
        raise ModelError(f"{label} must give an array of shape {argument.shape}, and gave {_describe(result)}")
    if not np.isfinite(result).all():
        raise ModelError(f"{label} gave numbers that are not finite; check its divisions and roots")


def _describe(result: Any) -> str:
    return f"shape {np.shape(result)}" if isinstance(result, np.ndarray) else f"a {type(result).__name__}"
