"""The committed stub of the compiled module matches the module: names, parameters, defaults.

pybind11 writes each function's signature into its docstring as Python; both sides are parsed and compared.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest
from perfect_bvh import _core

# (parameter names with a `=` after those that have a default) of each overload that has others
Signatures = tuple[tuple[str, ...], ...]

# A default that is not an expression, such as <Mode.clay: 0>.
OPAQUE_DEFAULT = re.compile(r"= <[^>]*>")


def parameters_of(function: ast.FunctionDef) -> tuple[str, ...]:
    arguments = function.args
    positional = [*arguments.posonlyargs, *arguments.args]
    required = len(positional) - len(arguments.defaults)
    names = [a.arg if i < required else f"{a.arg}=" for i, a in enumerate(positional)]
    names += [f"*{arguments.vararg.arg}"] if arguments.vararg else []
    keywords = zip(arguments.kwonlyargs, arguments.kw_defaults, strict=True)
    names += [a.arg if default is None else f"{a.arg}=" for a, default in keywords]
    return tuple(names)


def signatures_in_docstring(name: str, docstring: str) -> Signatures:
    """Signatures from the lines that pybind11 puts on top of a docstring: `name(...)` or `1. name(...)`."""
    found = []
    for line in docstring.splitlines():
        match = re.match(rf"(?:\d+\. )?({re.escape(name)}\(.*)", line)
        if match and "(*args, **kwargs)" not in line:
            text = OPAQUE_DEFAULT.sub("= ...", match.group(1))
            found.append(parameters_of(function_from(f"def {text}: ...")))
    return tuple(sorted(set(found)))  # those of float32 and float64 are one


def function_from(source: str) -> ast.FunctionDef:
    function = ast.parse(source).body[0]
    assert isinstance(function, ast.FunctionDef)
    return function


def flatten_stub(body: list[ast.stmt], prefix: str = "") -> Iterator[tuple[str, Signatures]]:
    """(dotted name, signatures) of everything public in a stub; () for attributes, properties and classes."""
    overloads: dict[str, list[tuple[str, ...]]] = {}
    for node in body:
        if isinstance(node, ast.ClassDef):
            yield prefix + node.name, ()
            yield from flatten_stub(node.body, f"{prefix}{node.name}.")
        elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            yield prefix + node.target.id, ()
        elif isinstance(node, ast.FunctionDef):
            decorators = {ast.unparse(decorator).split(".")[-1] for decorator in node.decorator_list}
            is_value = bool(decorators & {"property", "setter"})
            overloads.setdefault(node.name, []).extend([] if is_value else [parameters_of(node)])
    for name, signatures in overloads.items():
        yield prefix + name, tuple(sorted(signatures))


def flatten_module(owner: object, prefix: str = "") -> Iterator[tuple[str, Signatures]]:
    """The same for the module itself."""
    for name, value in vars(owner).items():
        if name == "__init__" and isinstance(owner, type):
            if "__init__(self" in (value.__doc__ or ""):
                yield f"{prefix}__init__", signatures_in_docstring(name, value.__doc__ or "")
        elif name.startswith("_"):
            continue
        elif isinstance(value, type):
            yield prefix + name, ()
            yield from flatten_module(value, f"{prefix}{name}.")
        else:
            function = value.__func__ if isinstance(value, staticmethod) else value
            yield prefix + name, signatures_in_docstring(name, function.__doc__ or "") if callable(function) else ()


def differences(stub: dict[str, Signatures], module: dict[str, Signatures]) -> list[str]:
    return [
        *(f"the stub lacks {name}" for name in sorted(module.keys() - stub.keys())),
        *(f"only the stub has {name}" for name in sorted(stub.keys() - module.keys())),
        *(
            f"{name}: stub {stub[name]}, module {module[name]}"
            for name in sorted(stub.keys() & module.keys())
            if stub[name] != module[name]
        ),
    ]


def public(items: Iterator[tuple[str, Signatures]]) -> dict[str, Signatures]:
    """Leave out names that begin with an underscore, except constructors."""
    return {
        name: signatures
        for name, signatures in items
        if name.split(".")[-1] == "__init__" or not name.split(".")[-1].startswith("_")
    }


def test_the_stub_matches_the_module(repository: Path) -> None:
    source = (repository / "native" / "python" / "perfect_bvh" / "_core.pyi").read_text(encoding="utf-8")
    stub = public(flatten_stub(ast.parse(source).body))
    module = public(flatten_module(_core))
    assert len(module) > 1
    assert differences(stub, module) == []


@pytest.mark.parametrize(
    ("stub", "complaints"),
    [
        ("def cast(rays: int, mask: int = ...) -> int: ...", []),
        ("def cast(rays: int, mask: int) -> int: ...", ["cast: stub (('rays', 'mask'),), module (('rays', 'mask='),)"]),
        (
            "def cast(mask: int, rays: int = ...) -> int: ...",
            ["cast: stub (('mask', 'rays='),), module (('rays', 'mask='),)"],
        ),
        ("", ["the stub lacks cast"]),
        (
            "def cast(rays: int, mask: int = ...) -> int: ...\ndef shoot() -> None: ...",
            ["only the stub has shoot"],
        ),
    ],
)
def test_a_wrong_stub_is_found(stub: str, complaints: list[str]) -> None:
    def cast() -> None:
        pass

    cast.__doc__ = "cast(rays: typing.SupportsInt, mask: Mask = <Mask.all: 63>) -> int\n\nSays more.\n"
    module = public(flatten_module(SimpleNamespace(cast=cast)))
    assert differences(public(flatten_stub(ast.parse(stub).body)), module) == complaints
